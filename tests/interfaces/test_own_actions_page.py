"""`docs/own-actions.md` is true: its files are written and its commands run, from top to bottom."""

from __future__ import annotations

import os
import re
import signal
import subprocess
from pathlib import Path

import pytest

from tests.conftest import without_noise
from tests.interfaces.conftest import environment

PAGE = Path(__file__).parents[2] / "docs" / "own-actions.md"
FENCE = re.compile(r'^```(\w+)(?: title="([^"]+)")?\n(.*?)^```$', re.M | re.S)
ELSEWHERE = ("python3 -m venv", "pip install")
"""Commands that the fixture `python` stands in for."""
PATIENCE = 150.0


@pytest.mark.long
@pytest.mark.heavy
def test_from_an_empty_folder_to_a_typed_tested_call(
    shared: Path, python: str, tmp_path: Path, ros_domain: int
) -> None:
    folder = tmp_path / "empty"
    folder.mkdir()
    commands = Path(python).parent
    program = commands / "actionkit"
    program.write_text(f'#!/bin/sh\nexec {python} -m actionkit "$@"\n')
    program.chmod(0o755)
    env = environment(folder, ROS_DOMAIN_ID=str(ros_domain))
    env["PATH"] = f"{commands}{os.pathsep}{env['PATH']}"
    del env["PYTHONPATH"]
    printed = ""
    others: list[subprocess.Popen[bytes]] = []
    try:
        for language, title, block in FENCE.findall(PAGE.read_text("utf-8")):
            if language == "sh" and title:
                others.append(
                    subprocess.Popen(
                        ["bash", "-c", block], cwd=folder, env=env, start_new_session=True
                    )
                )
            elif language == "sh":
                lines = [one for one in block.splitlines() if not one.startswith(ELSEWHERE)]
                done = subprocess.run(
                    ["bash", "-e", "-c", "\n".join(lines)],
                    cwd=folder,
                    env=env,
                    capture_output=True,
                    text=True,
                    timeout=PATIENCE,
                    check=False,
                )
                assert done.returncode == 0, block + done.stdout + done.stderr
                printed += without_noise(done.stdout)
            elif title:
                (folder / title).parent.mkdir(parents=True, exist_ok=True)
                (folder / title).write_text(block)
    finally:
        for other in others:
            os.killpg(other.pid, signal.SIGKILL)
            other.wait()
    assert "pick_interfaces: built in" in printed
    assert "# which one" in printed  # of `actionkit show`
    assert "50 %\npicked bolt\n" in printed
    assert "picked nut" in printed
    assert "arrived" in printed


def test_the_error_that_it_shows(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from actionkit.cli._app import run

    texts = {title: block for _, title, block in FENCE.findall(PAGE.read_text("utf-8"))}
    package = tmp_path / "pick_interfaces"
    (package / "action").mkdir(parents=True)
    (package / "package.xml").write_text(texts["pick_interfaces/package.xml"])
    action = package / "action" / "Pick.action"
    action.write_text("\n\nint object_id\n---\n---\n")
    assert run(["interfaces", "build", str(package), "-o", str(tmp_path / "out")]) == 2
    shown = next(text for text in re.findall(r"^Error: .*$", PAGE.read_text("utf-8"), re.M))
    assert capsys.readouterr().err.strip() == shown.replace("/home/me", str(tmp_path))

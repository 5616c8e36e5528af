"""mypy and pyright, both strict, know the types of users' own packages from stubs only (C9.2)."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

PROJECT = Path(__file__).with_name("project")
STRICT = """\
[tool.mypy]
strict = true
mypy_path = "typings"

[tool.pyright]
typeCheckingMode = "strict"
"""
PACKAGES = ["odd_interfaces", "nav_msgs", "sensor_msgs", "test_msgs"]
"""With all that they use: action_msgs, builtin_interfaces, geometry_msgs, std_msgs."""

Found = dict[str, dict[int, list[tuple[str, str]]]]
"""File -> line number -> (kind of the error, its text)."""


def mypy(project: Path) -> Found:
    command = ["mypy", "--no-error-summary", "--no-pretty", "--cache-dir", ".cache", "."]
    text = run(command, project)
    found: Found = {}
    for file, line, said, kind in re.findall(
        r"^([\w/.]+):(\d+): error: (.*)  \[([\w-]+)\]$", text, re.M
    ):
        found.setdefault(file, {}).setdefault(int(line), []).append((kind, said))
    return found


def pyright(project: Path) -> Found:
    text = run(["pyright", "--outputjson", "--pythonpath", sys.executable], project)
    report = json.loads(text[text.index("{") :])
    assert report["summary"]["filesAnalyzed"] >= 3, report
    found: Found = {}
    for error in report["generalDiagnostics"]:
        file = Path(error["file"]).relative_to(project).as_posix()
        line = error["range"]["start"]["line"] + 1
        if error["severity"] == "error":
            found.setdefault(file, {}).setdefault(line, []).append(
                (error.get("rule", "?"), error["message"])
            )
    return found


def run(command: list[str], project: Path) -> str:
    done = subprocess.run(
        [sys.executable, "-m", *command],
        capture_output=True,
        text=True,
        check=False,
        timeout=200,
        cwd=project,
        # The packages themselves are found as those of a sourced workspace are.
        env={**os.environ, "PYTHONPATH": str(project.parent / "interfaces")},
    )
    assert done.returncode in (0, 1), done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def project(interfaces: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A user's project: stubs in `typings/`, those of plain_interfaces installed."""
    place = tmp_path_factory.mktemp("user")
    project = place / "project"
    shutil.copytree(PROJECT, project, ignore=shutil.ignore_patterns("__pycache__"))
    (project / "pyproject.toml").write_text(STRICT)
    shutil.copytree(interfaces, place / "interfaces")
    for arguments in (PACKAGES, ["plain_interfaces", "--install"]):
        subprocess.run(
            [sys.executable, "-m", "actionkit", "stubs", *arguments],
            check=arguments is not PACKAGES,  # a type of odd_interfaces uses a package that is gone
            capture_output=True,
            timeout=120,
            cwd=project,
            env={**os.environ, "PYTHONPATH": str(place / "interfaces")},
        )
    return project


@pytest.mark.heavy
@pytest.mark.parametrize(
    "check",
    [pytest.param(mypy, marks=pytest.mark.long), pyright],
    ids=lambda check: check.__name__,
)
def test_right_code_is_clean_and_wrong_code_refused(check: object, project: Path) -> None:
    assert callable(check)
    pytest.importorskip(check.__name__)
    found: Found = check(project)
    wrong = found.pop("wrong.py", {})
    # Neither the user's code nor the stubs themselves have errors.
    assert found == {}
    lines = (project / "wrong.py").read_text().splitlines()
    expected = {
        number: set(re.findall(r"[\w-]+", match[1]))
        for number, line in enumerate(lines, 1)
        if (match := re.search(r"# error\[(.*?)\]", line))
        if (check is pyright) or not match[1].startswith("report")
    }
    assert len(expected) > 30
    assert {n: wrong[n] for n in wrong if n not in expected} == {}
    assert [lines[n - 1] for n in expected if n not in wrong] == []
    for number, errors in wrong.items():
        assert {kind for kind, _ in errors} <= expected[number], (lines[number - 1], errors)

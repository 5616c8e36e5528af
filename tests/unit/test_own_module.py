"""Processes that ActionKit starts of itself do not import what lies in the current folder."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from actionkit._model.environment.own_module import command_for


def test_it_gets_its_words_and_imports_from_where_this_process_does(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("one", "other"):
        (tmp_path / name).mkdir()
    (tmp_path / "one" / "told.py").write_text("import sys, beside; print(__name__, sys.argv[1:])")
    (tmp_path / "other" / "beside.py").touch()
    for name in ("one", "other"):
        monkeypatch.syspath_prepend(tmp_path / name)
    command = command_for("told", "a", "--b")
    assert command[0] == sys.executable
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert (done.stdout, done.stderr) == ("__main__ ['a', '--b']\n", "")


def test_modules_in_the_current_folder_are_not_imported(tmp_path: Path) -> None:
    for name in ("queue", "json", "click"):
        (tmp_path / f"{name}.py").write_text("raise RuntimeError('the wrong module')")
    options = {"cwd": tmp_path, "capture_output": True, "text": True, "timeout": 60}
    done = subprocess.run(command_for("actionkit", "list", "--help"), check=False, **options)
    assert (done.returncode, done.stderr) == (0, "")
    assert "List the actions" in done.stdout
    words = [sys.executable, "-m", "actionkit", "list", "--help"]
    assert "the wrong module" in subprocess.run(words, check=False, **options).stderr

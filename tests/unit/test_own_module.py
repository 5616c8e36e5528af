"""Processes that ActionKit starts of itself do not import what lies in the current folder."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from actionkit._model.own_module import command_for


def test_modules_in_the_current_folder_are_not_imported(tmp_path: Path) -> None:
    for name in ("queue", "json", "click"):
        (tmp_path / f"{name}.py").write_text("raise RuntimeError('the wrong module')")
    options = {"cwd": tmp_path, "capture_output": True, "text": True, "timeout": 60}
    done = subprocess.run(command_for("actionkit", "list", "--help"), check=False, **options)
    assert (done.returncode, done.stderr) == (0, "")
    assert "List the actions" in done.stdout
    words = [sys.executable, "-m", "actionkit", "list", "--help"]
    assert "the wrong module" in subprocess.run(words, check=False, **options).stderr

"""The program of the page on windows stops the robot, however it is told to end.

Skipped where PyQt6 is not found: `.ci/run` installs it into a folder of its own, and names that in
ACTIONKIT_BESIDE.
"""

from __future__ import annotations

import importlib.util
import os
import signal
import sys
from typing import Any

import pytest

from tests.docs.snippets import blocks
from tests.docs.test_pages import DOCS

BESIDE = os.environ.get("ACTIONKIT_BESIDE", "")
PRESS_DRIVE = """
from PyQt6.QtCore import QTimer
from PyQt6.QtWidgets import QApplication, QPushButton
def press():
    for widget in QApplication.allWidgets():
        if isinstance(widget, QPushButton) and widget.text() == "Drive":
            widget.click()
execute = QApplication.exec
QApplication.exec = lambda _: (QTimer.singleShot(0, press), execute())[1]
"""


@pytest.mark.long
@pytest.mark.skipif(not BESIDE and not importlib.util.find_spec("PyQt6"), reason="needs PyQt6")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_window_is_told_to_end(
    number: signal.Signals, action_server: Any, run_script: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("QT_QPA_PLATFORM", "offscreen")
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(filter(None, [BESIDE, *sys.path[:1]])))
    server = action_server("fibonacci", period=0.1)
    (text,) = [b.text for b in blocks(DOCS / "guides" / "gui.md") if b.mark == "file: window.py"]
    program = run_script(PRESS_DRIVE + text)
    goal_id = server.wait_for("executing", timeout=60)[0].goal_id
    program.process.send_signal(number)
    server.wait_for("canceled", goal_id=goal_id)
    code, out, err = program.finish(20)
    assert (code, out, "Traceback" in err) == (0, "", False), err

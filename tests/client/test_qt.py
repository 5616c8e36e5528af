"""A program with PyQt does not crash at its end, while callbacks emit signals (C1.10).

Skipped where PyQt6 is not found: `.ci/run` installs it into a folder of its own, and names that in
ACTIONKIT_BESIDE.
"""

from __future__ import annotations

import importlib.util
import os

import pytest

BESIDE = os.environ.get("ACTIONKIT_BESIDE", "")
PROGRAM = """
import os, sys, time
sys.path.append(os.environ.get("ACTIONKIT_BESIDE", ""))
from PyQt6.QtCore import QCoreApplication, QObject, QTimer, pyqtSignal
from actionkit import Client, Timeouts
from test_msgs.action import Fibonacci

class Signals(QObject):
    feedback = pyqtSignal(object)
    done = pyqtSignal(object)

class Window(QObject):
    def show(self, it):
        time.sleep(0.001)  # lets other threads go on, as drawing does

app, signals, window = QCoreApplication([]), Signals(), Window()
signals.feedback.connect(window.show)
signals.done.connect(lambda future: window.show(future))  # on the thread that emits it

def done(future):
    for _ in range(100):
        signals.done.emit(future)

client = Client(Fibonacci, "fibonacci", timeouts=Timeouts(server=60))
for _ in range(2):
    client.call_async({"order": 90}, signals.feedback.emit).add_done_callback(done)
client.call({"order": 3}, on_feedback=signals.feedback.emit)
if sys.argv[1] == "quits":
    QTimer.singleShot(100, app.quit)
    app.exec()
"""
RUNS = 30
AT_A_TIME = 3


@pytest.mark.long
@pytest.mark.skipif(not BESIDE and not importlib.util.find_spec("PyQt6"), reason="needs PyQt6")
@pytest.mark.parametrize("end", ["quits", "ends"])
def test_no_crash_at_the_end(end, action_server, run_script):
    action_server("fibonacci", period=0.02)
    for _ in range(RUNS // AT_A_TIME):
        programs = [run_script(PROGRAM, end, fresh=True) for _ in range(AT_A_TIME)]
        ends = [program.finish(60) for program in programs]
        # That a busy server has not confirmed a cancellation may be told.
        assert [(code, "raised" in err) for code, _, err in ends] == [(0, False)] * AT_A_TIME

"""In Jupyter the stop button cancels the goal of a cell (C2.5).

Skipped where Jupyter's kernel is not found; `test_qt.py` tells where it is looked for.
"""

from __future__ import annotations

import importlib.util

import pytest

from tests.client.test_qt import BESIDE

PROGRAM = """
import os, sys
beside = os.environ.get("ACTIONKIT_BESIDE", "")
sys.path.append(beside)
os.environ["PYTHONPATH"] = beside
os.environ["JUPYTER_PATH"] = os.path.join(beside, "share", "jupyter")
from jupyter_client.manager import start_new_kernel
manager, client = start_new_kernel(kernel_name="python3", stderr=open(os.devnull, "w"))
def run(code, *, stop=False):
    cell, told = client.execute(code), []
    while True:
        message = client.get_iopub_msg(timeout=60)
        content = message["content"]
        if message["parent_header"].get("msg_id") != cell:
            continue
        if message["msg_type"] == "stream":
            told.append(content["name"])
            if stop:
                manager.interrupt_kernel()
                stop = False
        elif message["msg_type"] == "error":
            told.append(content["ename"])
        elif message["msg_type"] == "execute_result":
            told += content["data"]
        elif content.get("execution_state") == "idle":
            return told
try:
    print(run("from actionkit import Client; from test_msgs.action import Fibonacci\\n"
              "client = Client(Fibonacci, 'fibonacci')\\n"
              "def tell(feedback): print('running', flush=True)"))
    print(run("client.call({'order': 1}, on_feedback=tell)", stop=True))
    print(run("await client.call_async({'order': 1}, on_feedback=tell)", stop=True))
    print(run("client.call_async({'order': 1}, timeout=0.0).outcome()"))
finally:
    manager.shutdown_kernel(now=True)
"""


@pytest.mark.long
@pytest.mark.skipif(not BESIDE and not importlib.util.find_spec("ipykernel"), reason="no Jupyter")
def test_the_stop_button_cancels_the_goal(action_server, run_script):
    server = action_server("never_finishes")
    code, out, err = run_script(PROGRAM, fresh=True).finish(120)
    assert code == 0, err
    assert out.splitlines() == [
        "[]",
        "['stdout', 'KeyboardInterrupt']",  # and no warning that it blocks the event loop
        "['stdout', 'CancelledError']",
        "['text/plain', 'text/html']",
    ]
    assert len(server.wait_for("canceled", count=2)) == 2

"""If gevent has replaced Python's threads, a client raises and does not wait for ever (C1.1).

Skipped where gevent is not found; `test_qt.py` tells where it is looked for.
"""

from __future__ import annotations

import importlib.util

import pytest

from tests.client.test_qt import BESIDE

PROGRAM = """
import os, sys
sys.path.append(os.environ.get("ACTIONKIT_BESIDE", ""))
from gevent import monkey
monkey.patch_all(thread=sys.argv[1] == "yes")
from actionkit import Client
from test_msgs.action import Fibonacci
try:
    with Client(Fibonacci, "fibonacci") as client:
        print(client.call({"order": 1}, timeout=10).sequence)
except RuntimeError as error:
    print(error)
"""


@pytest.mark.skipif(not BESIDE and not importlib.util.find_spec("gevent"), reason="needs gevent")
@pytest.mark.parametrize(
    ("threads", "told"),
    [("yes", "gevent has replaced Python's threads, and"), ("no", "array('i', [0, 1])")],
)
def test_gevent_replaces_threads(threads, told, action_server, run_script):
    action_server("fibonacci")
    code, out, err = run_script(PROGRAM, threads, fresh=True).finish()
    assert code == 0, err
    assert out.startswith(told)

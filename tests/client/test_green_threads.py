"""If a library has replaced Python's threads, a client raises and does not wait for ever (C1.1).

Skipped where gevent and eventlet are not found; `test_qt.py` tells where they are looked for.
"""

from __future__ import annotations

import importlib.util

import pytest

from tests.client.test_qt import BESIDE

PROGRAM = """
import os, sys, warnings
sys.path.append(os.environ.get("ACTIONKIT_BESIDE", ""))
library, threads = sys.argv[1], sys.argv[2] == "yes"
if library == "gevent":
    from gevent import monkey
    monkey.patch_all(thread=threads)
else:
    with warnings.catch_warnings():  # it says that it is deprecated
        warnings.simplefilter("ignore")
        import eventlet
    eventlet.monkey_patch(thread=threads)
from actionkit import Client
from test_msgs.action import Fibonacci
try:
    with Client(Fibonacci, "fibonacci") as client:
        print(client.call({"order": 1}, timeout=10).sequence)
except RuntimeError as error:
    print(error)
"""


@pytest.mark.parametrize("threads", ["yes", "no"])
@pytest.mark.parametrize("library", ["gevent", "eventlet"])
def test_a_library_replaces_threads(library, threads, action_server, run_script):
    if not BESIDE and not importlib.util.find_spec(library):
        pytest.skip(f"needs {library}")
    action_server("fibonacci")
    code, out, err = run_script(PROGRAM, library, threads, fresh=True).finish()
    assert code == 0, err
    told = f"{library} has replaced Python's threads, and ActionKit needs real ones: call {library}"
    assert out.startswith(told if threads == "yes" else "array('i', [0, 1])")

"""Imports the modules that need rclpy, late: `import actionkit` is quick, and works without it."""

from __future__ import annotations

import threading
from typing import Any

from actionkit._model.missing import cannot_import


def transport() -> tuple[Any, Any]:
    """Return the modules `_ros.sending.connection` and `_calls.sending.session`, ready for use.

    Raises:
        ImportError: rclpy is not importable.
        RuntimeError: A library, such as gevent or eventlet, has replaced Python's threads.
    """
    _check_threads()
    try:
        from actionkit._calls.ending import exit as _exit
        from actionkit._calls.sending import session as _session
        from actionkit._ros.sending import connection
    except ImportError as error:
        raise ImportError(f"ActionKit needs rclpy. {cannot_import('rclpy', error)}") from error
    _exit.arm()
    return connection, _session


_PATCHES = {
    "gevent": "gevent.monkey.patch_all(thread=False)",
    "eventlet": "eventlet.monkey_patch(thread=False)",
}


def _check_threads() -> None:
    # A lock tells it: debuggers, too, replace the function that starts threads.
    library = type(threading.Lock()).__module__.partition(".")[0]
    if library != "_thread":
        remedy = f"call {_PATCHES[library]}, or " if library in _PATCHES else ""
        raise RuntimeError(
            f"{library} has replaced Python's threads, and ActionKit needs real ones: {remedy}make"
            " the client in a process of its own"
        )

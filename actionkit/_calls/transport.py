"""Imports the modules that need rclpy, late: `import actionkit` is quick, and works without it."""

from __future__ import annotations

import sys
from typing import Any

from actionkit._model.missing import cannot_import


def transport() -> tuple[Any, Any]:
    """Return the modules `_ros.port` and `_calls.session`, ready for use.

    Raises:
        ImportError: rclpy is not importable.
        RuntimeError: gevent has replaced Python's threads.
    """
    _check_threads()
    try:
        from actionkit._calls import exit as _exit
        from actionkit._calls import session as _session
        from actionkit._ros import port
    except ImportError as error:
        raise ImportError(f"ActionKit needs rclpy. {cannot_import('rclpy', error)}") from error
    _exit.arm()
    return port, _session


def _check_threads() -> None:
    monkey = sys.modules.get("gevent.monkey")
    if monkey is not None and monkey.is_module_patched("threading"):
        raise RuntimeError(
            "gevent has replaced Python's threads, and ActionKit needs real ones: call"
            " gevent.monkey.patch_all(thread=False), or make the client in a process of its own"
        )

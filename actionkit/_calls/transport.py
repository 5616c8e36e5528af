"""Imports what needs rclpy, for the first client of a process."""

from __future__ import annotations

from typing import Any


def transport() -> tuple[Any, Any]:
    """Import what needs rclpy, late: `import actionkit` works, and is quick, without rclpy."""
    try:
        from actionkit._calls import exit as _exit
        from actionkit._calls import session as _session
        from actionkit._ros import port
    except ImportError as error:
        raise ImportError(
            f"ActionKit needs rclpy, which cannot be imported ({error}). On a machine with a"
            " ROS installation source its setup file; elsewhere: pip install 'actionkit[ros]'"
        ) from error
    _exit.arm()
    return port, _session

"""The exit codes of the command line."""

from __future__ import annotations

from enum import IntEnum


class Exit(IntEnum):
    """What the command `actionkit` ends with."""

    OK = 0
    FAILED = 1
    """The command ran, and did not come out as it should."""
    USAGE = 2
    """An unknown command, option or argument."""
    NO_ROS = 3
    """rclpy, or a message package that is needed, cannot be imported."""
    INTERRUPTED = 130
    """Ctrl-C."""

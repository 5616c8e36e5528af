"""Tells which release of ROS 2 rclpy is from, without an import of rclpy."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, version

_KILTED = 9
"""The major version of its rclpy; Jazzy has 7."""


def is_kilted_or_later() -> bool:
    """Return whether rclpy is that of ROS 2 Kilted or of a later release."""
    try:
        return int(version("rclpy").partition(".")[0]) >= _KILTED
    except (PackageNotFoundError, ValueError):
        return False

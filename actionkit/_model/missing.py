"""The text for what cannot be imported: the same from Python and on the command line."""

from __future__ import annotations

_PACKAGES = {"test_msgs": ("ros-jazzy-test-msgs", "demo")}
"""Module -> its package of a ROS installation, and the extra of ActionKit that has it."""


def cannot_import(module: str, error: BaseException) -> str:
    """Return what to do where a package of ROS cannot be imported.

    Args:
        module: Such as `rclpy`.
        error: What its import raised.
    """
    package, extra = _PACKAGES.get(module, ("", "ros"))
    installed = f", and install {package} where it is missing" if package else ""
    return (
        f"{module} cannot be imported here ({type(error).__name__}: {error}). On a machine with a"
        " ROS 2 installation source its setup file, such as"
        f" /opt/ros/jazzy/setup.bash{installed}; elsewhere: pip install 'actionkit[{extra}]'"
    )

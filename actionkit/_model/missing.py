"""The text for what cannot be imported: the same from Python and on the command line."""

from __future__ import annotations


def cannot_import(module: str, error: BaseException) -> str:
    """Return what to do where a package of ROS cannot be imported.

    Args:
        module: `rclpy`, or `test_msgs`, which the reference servers speak.
        error: What its import raised.
    """
    extra = "ros" if module == "rclpy" else "demo"
    package = f", and install ros-jazzy-{module.replace('_', '-')} where it is not there"
    return (
        f"{module} cannot be imported here ({type(error).__name__}: {error}). On a machine with a"
        " ROS 2 installation source its setup file, such as /opt/ros/jazzy/setup.bash"
        f"{'' if module == 'rclpy' else package}; elsewhere: pip install 'actionkit[{extra}]'"
    )

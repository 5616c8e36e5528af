"""The error texts for packages that cannot be imported, for Python and the command line."""

from __future__ import annotations

import sys

from actionkit._model.ros_packages import wheel

WITH_ROS = (
    "On a machine with a ROS 2 installation (Ubuntu 24.04, for Jazzy) source its setup file,"
    " `source /opt/ros/jazzy/setup.bash`, and use its Python, or a virtual environment made by"
    " `python3 -m venv --system-site-packages .venv`"
)
"""How to use the rclpy of an installed ROS, which needs the system's numpy and others."""
ON_LINUX = "ActionKit runs on Linux only: use a Linux machine, a virtual machine or a container"
"""What to do on other systems: PyPI has no rclpy for them."""
RCLPY = "'ros-jazzy-rclpy[fastrtps]'"
"""What to install with pip if there is no ROS installation, quoted for a shell."""


def cannot_import(module: str, error: BaseException) -> str:
    """Return what to do if a package of ROS cannot be imported, such as `rclpy` or `test_msgs`."""
    text = f"{module} cannot be imported here ({type(error).__name__}: {error})."
    if sys.platform != "linux":
        return f"{text} {ON_LINUX}"
    package = wheel(module)
    install = "" if module == "rclpy" else f" (`sudo apt install {package}` where it lacks that)"
    wanted = RCLPY if module == "rclpy" else package
    return f"{text} {WITH_ROS}{install}. Elsewhere: pip install {wanted}"

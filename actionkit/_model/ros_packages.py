"""Says where to get packages of ROS, with names and addresses that are known to exist.

Anybody can register a free name on a package index. So an error never proposes a package with a
name that was only derived from the name of a ROS package.
"""

from __future__ import annotations

import re
from collections.abc import Collection

_ON_PYPI = re.findall(
    r"\w+",
    "action_msgs actionlib_msgs builtin_interfaces diagnostic_msgs geometry_msgs lifecycle_msgs"
    " nav_msgs rcl_interfaces rclpy rosgraph_msgs sensor_msgs service_msgs shape_msgs std_msgs"
    " std_srvs stereo_msgs test_msgs trajectory_msgs type_description_interfaces"
    " unique_identifier_msgs visualization_msgs",
)
"""Packages with a wheel for Jazzy on PyPI, looked up on 2026-11-26."""
_REPOSITORIES = {
    "ackermann_msgs": "ros-drivers/ackermann_msgs",
    "control_msgs": "ros-controls/control_msgs",
    "controller_manager_msgs": "ros-controls/ros2_control",
    "example_interfaces": "ros2/example_interfaces",
    "geographic_msgs": "ros-geographic-info/geographic_info",
    "grid_map_msgs": "ANYbotics/grid_map",
    "irobot_create_msgs": "iRobotEducation/irobot_create_msgs",
    "map_msgs": "ros-planning/navigation_msgs",
    "mavros_msgs": "mavlink/mavros",
    "moveit_msgs": "moveit/moveit_msgs",
    "nav2_msgs": "ros-navigation/navigation2",
    "object_recognition_msgs": "wg-perception/object_recognition_msgs",
    "octomap_msgs": "OctoMap/octomap_msgs",
    "pcl_msgs": "ros-perception/pcl_msgs",
    "tf2_msgs": "ros2/geometry2",
    "vision_msgs": "ros-perception/vision_msgs",
}
"""Other packages -> their source on GitHub."""


def wheel(name: str) -> str | None:
    """Return the wheel's name on PyPI for a package of ROS; `None` if none is known."""
    return f"ros-jazzy-{name.replace('_', '-')}" if name in _ON_PYPI else None


def repository(name: str) -> str | None:
    """Return the address of a package's source; `None` if it is not known."""
    return f"https://github.com/{_REPOSITORIES[name]}" if name in _REPOSITORIES else None


def how_to_get(names: Collection[str]) -> list[str]:
    """Return what to do about missing packages: a pip command, and where the sources are."""
    wheels = [found for name in sorted(names) if (found := wheel(name)) is not None]
    sources = [
        name if (address := repository(name)) is None else f"{name} ({address})"
        for name in sorted(names)
        if wheel(name) is None
    ]
    steps = [f"pip install {' '.join(wheels)}"] if wheels else []
    if sources:
        steps.append(
            f"PyPI is not known to have {joined(sources, 'or')}: get the source, put it beside the"
            " package that needs it, and build the folder that has both"
        )
    return steps


def joined(words: list[str], last: str = "and") -> str:
    """Return the words as a list in a sentence: `a, b and c`."""
    return f" {last} ".join(filter(None, [", ".join(words[:-1]), *words[-1:]]))

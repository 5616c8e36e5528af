"""Builds the interface packages that servers of the field use, and that no wheel has."""

from __future__ import annotations

import subprocess
import sys
from functools import cache
from pathlib import Path

from tests.field.sources import FIELD, built, need, upstream

_TYPES = (
    "example_interfaces/action/Fibonacci",
    "py_trees_ros_interfaces/action/Dock",
    "rosbridge_msgs/msg/ConnectedClients",
)
"""What the servers use. Of three packages, these alone are built: it takes 8 s instead of 80."""


@cache
def interfaces() -> Path:
    """Return the folder for `sys.path` that has the packages; build them where they are not.

    Nothing else is needed: their libraries find each other, and ROS finds its own.

    Raises:
        Missing: They cannot be built here.
    """
    generators = sorted(Path(sys.prefix, "share").glob("rosidl_*/package.xml"))
    name = f"interfaces-{sys.implementation.cache_tag}"
    return built(name, _build, FIELD / "upstream.tar.xz", *generators)


def importable() -> None:
    """Let this process import the packages. Programs that it starts are told by `sys.path`."""
    folder = str(interfaces())
    if folder not in sys.path:
        sys.path.append(folder)


def _build(folder: Path) -> None:
    need("g++")
    sources = upstream() / "interfaces"
    only = [word for name in _TYPES for word in ("--only", name)]
    command = [sys.executable, "-m", "actionkit", "interfaces", "build", sources, "-o", folder]
    subprocess.run([*command, *only], check=True, stdout=subprocess.DEVNULL)

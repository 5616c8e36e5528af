"""The interface package that comes with ActionKit, as sources."""

from __future__ import annotations

from pathlib import Path

NAME = "actionkit_interfaces"


def folder() -> Path:
    """Return the folder of its sources, which `colcon build` takes too."""
    return Path(__file__).parent / NAME

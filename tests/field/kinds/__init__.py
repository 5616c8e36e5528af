"""The servers of the field: one module for each family."""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec

from tests.field.kind import Kind

_FAMILIES = ("nav2", "ros2_control", "micro_ros", "rosbridge", "python", "examples")


def _kinds() -> tuple[Kind, ...]:
    names = [f"{__name__}.{family}" for family in _FAMILIES]
    return tuple(kind for name in names if find_spec(name) for kind in import_module(name).KINDS)


KINDS = _kinds()

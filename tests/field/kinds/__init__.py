"""The servers of the field: one module for each family."""

from __future__ import annotations

from tests.field.kinds import examples, micro_ros, nav2, python, ros2_control, rosbridge

KINDS = (
    *nav2.KINDS,
    *ros2_control.KINDS,
    *micro_ros.KINDS,
    *rosbridge.KINDS,
    *python.KINDS,
    *examples.KINDS,
)

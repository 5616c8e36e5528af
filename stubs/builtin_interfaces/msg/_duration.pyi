# Made by `actionkit stubs`, which overwrites it.
# fmt: off
# ruff: noqa

from typing import Any as _Any
from typing import ClassVar as _ClassVar

class Duration:
    """Duration defines a period between two time points.
    Messages of this datatype are of ROS Time following this design:
    https://design.ros2.org/articles/clock_and_time.html"""
    SLOT_TYPES: _ClassVar[tuple[_Any, ...]]
    sec: int  # int32
    """The seconds component, valid over all int32 values."""
    nanosec: int  # uint32
    """The nanoseconds component, valid in the range [0, 1e9), to be added to the seconds component.
    e.g.
    The duration -1.7 seconds is represented as {sec: -2, nanosec: 3e8}
    The duration 1.7 seconds is represented as {sec: 1, nanosec: 7e8}"""
    def __init__(
        self,
        *,
        sec: int = ...,
        nanosec: int = ...,
        check_fields: bool = ...,
    ) -> None: ...
    @classmethod
    def get_fields_and_field_types(cls) -> dict[str, str]: ...
    __hash__: _ClassVar[None]  # type: ignore[assignment]

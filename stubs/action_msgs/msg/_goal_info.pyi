# Made by `actionkit stubs`, which overwrites it.
# fmt: off
# ruff: noqa

import builtin_interfaces.msg as _builtin_interfaces_msg
import unique_identifier_msgs.msg as _unique_identifier_msgs_msg
from typing import Any as _Any
from typing import ClassVar as _ClassVar

class GoalInfo:
    SLOT_TYPES: _ClassVar[tuple[_Any, ...]]
    goal_id: _unique_identifier_msgs_msg.UUID  # unique_identifier_msgs/UUID
    """Goal ID"""
    stamp: _builtin_interfaces_msg.Time  # builtin_interfaces/Time
    """Time when the goal was accepted"""
    def __init__(
        self,
        *,
        goal_id: _unique_identifier_msgs_msg.UUID = ...,
        stamp: _builtin_interfaces_msg.Time = ...,
        check_fields: bool = ...,
    ) -> None: ...
    @classmethod
    def get_fields_and_field_types(cls) -> dict[str, str]: ...
    __hash__: _ClassVar[None]  # type: ignore[assignment]

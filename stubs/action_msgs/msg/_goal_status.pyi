# Made by `actionkit stubs`, which overwrites it.
# fmt: off
# ruff: noqa

import action_msgs.msg as _action_msgs_msg
from typing import Any as _Any
from typing import ClassVar as _ClassVar

class GoalStatus:
    STATUS_ABORTED: _ClassVar[int] = 6
    STATUS_ACCEPTED: _ClassVar[int] = 1
    STATUS_CANCELED: _ClassVar[int] = 5
    STATUS_CANCELING: _ClassVar[int] = 3
    STATUS_EXECUTING: _ClassVar[int] = 2
    STATUS_SUCCEEDED: _ClassVar[int] = 4
    STATUS_UNKNOWN: _ClassVar[int] = 0
    SLOT_TYPES: _ClassVar[tuple[_Any, ...]]
    goal_info: _action_msgs_msg.GoalInfo  # action_msgs/GoalInfo
    status: int  # int8
    def __init__(
        self,
        *,
        goal_info: _action_msgs_msg.GoalInfo = ...,
        status: int = ...,
        check_fields: bool = ...,
    ) -> None: ...
    @classmethod
    def get_fields_and_field_types(cls) -> dict[str, str]: ...
    __hash__: _ClassVar[None]  # type: ignore[assignment]

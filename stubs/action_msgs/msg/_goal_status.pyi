# Made by `actionkit stubs`, which overwrites it.
# fmt: off
# ruff: noqa

import action_msgs.msg as _action_msgs_msg
from typing import Any as _Any
from typing import ClassVar as _ClassVar

class GoalStatus:
    """An action goal can be in one of these states after it is accepted by an action
    server.
    For more information, see http://design.ros2.org/articles/actions.html
    Indicates status has not been properly set.
    STATUS_UNKNOWN = 0
    The goal has been accepted and is awaiting execution.
    STATUS_ACCEPTED = 1
    The goal is currently being executed by the action server.
    STATUS_EXECUTING = 2
    The client has requested that the goal be canceled and the action server has
    accepted the cancel request.
    STATUS_CANCELING = 3
    The goal was achieved successfully by the action server.
    STATUS_SUCCEEDED = 4
    The goal was canceled after an external request from an action client.
    STATUS_CANCELED = 5
    The goal was terminated by the action server without an external request.
    STATUS_ABORTED = 6"""
    STATUS_ABORTED: _ClassVar[int] = 6
    STATUS_ACCEPTED: _ClassVar[int] = 1
    STATUS_CANCELED: _ClassVar[int] = 5
    STATUS_CANCELING: _ClassVar[int] = 3
    STATUS_EXECUTING: _ClassVar[int] = 2
    STATUS_SUCCEEDED: _ClassVar[int] = 4
    STATUS_UNKNOWN: _ClassVar[int] = 0
    SLOT_TYPES: _ClassVar[tuple[_Any, ...]]
    goal_info: _action_msgs_msg.GoalInfo  # action_msgs/GoalInfo
    """Goal info (contains ID and timestamp)."""
    status: int  # int8
    """Action goal state-machine status."""
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

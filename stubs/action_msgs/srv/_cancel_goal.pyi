# Made by `actionkit stubs`, which overwrites it.
# fmt: off
# ruff: noqa

import action_msgs.msg as _action_msgs_msg
import action_msgs.srv as _action_msgs_srv
import service_msgs.msg as _service_msgs_msg
from collections.abc import Sequence as _Sequence
from typing import Any as _Any
from typing import ClassVar as _ClassVar

class CancelGoal:
    class Request:
        """Cancel one or more goals with the following policy:
        - If the goal ID is zero and timestamp is zero, cancel all goals.
        - If the goal ID is zero and timestamp is not zero, cancel all goals accepted
        at or before the timestamp.
        - If the goal ID is not zero and timestamp is zero, cancel the goal with the
        given ID regardless of the time it was accepted.
        - If the goal ID is not zero and timestamp is not zero, cancel the goal with
        the given ID and all goals accepted at or before the timestamp."""
        SLOT_TYPES: _ClassVar[tuple[_Any, ...]]
        goal_info: _action_msgs_msg.GoalInfo  # action_msgs/GoalInfo
        """Goal info describing the goals to cancel, see above."""
        def __init__(
            self,
            *,
            goal_info: _action_msgs_msg.GoalInfo = ...,
            check_fields: bool = ...,
        ) -> None: ...
        @classmethod
        def get_fields_and_field_types(cls) -> dict[str, str]: ...
        __hash__: _ClassVar[None]  # type: ignore[assignment]

    class Response:
        """Return codes.
        Indicates the request was accepted without any errors.
        One or more goals have transitioned to the CANCELING state. The
        goals_canceling list is not empty.
        ERROR_NONE = 0
        Indicates the request was rejected.
        No goals have transitioned to the CANCELING state. The goals_canceling list is
        empty.
        ERROR_REJECTED = 1
        Indicates the requested goal ID does not exist.
        No goals have transitioned to the CANCELING state. The goals_canceling list is
        empty.
        ERROR_UNKNOWN_GOAL_ID = 2
        Indicates the goal is not cancelable because it is already in a terminal state.
        No goals have transitioned to the CANCELING state. The goals_canceling list is
        empty.
        ERROR_GOAL_TERMINATED = 3"""
        ERROR_GOAL_TERMINATED: _ClassVar[int] = 3
        ERROR_NONE: _ClassVar[int] = 0
        ERROR_REJECTED: _ClassVar[int] = 1
        ERROR_UNKNOWN_GOAL_ID: _ClassVar[int] = 2
        SLOT_TYPES: _ClassVar[tuple[_Any, ...]]
        return_code: int  # int8
        """Return code, see above definitions."""
        @property
        def goals_canceling(self) -> list[_action_msgs_msg.GoalInfo]:  # sequence<action_msgs/GoalInfo>
            """Goals that accepted the cancel request."""
        @goals_canceling.setter
        def goals_canceling(self, value: _Sequence[_action_msgs_msg.GoalInfo]) -> None: ...
        def __init__(
            self,
            *,
            return_code: int = ...,
            goals_canceling: _Sequence[_action_msgs_msg.GoalInfo] = ...,
            check_fields: bool = ...,
        ) -> None: ...
        @classmethod
        def get_fields_and_field_types(cls) -> dict[str, str]: ...
        __hash__: _ClassVar[None]  # type: ignore[assignment]

    class Event:
        SLOT_TYPES: _ClassVar[tuple[_Any, ...]]
        info: _service_msgs_msg.ServiceEventInfo  # service_msgs/ServiceEventInfo
        @property
        def request(self) -> list[_action_msgs_srv.CancelGoal.Request]: ...  # sequence<action_msgs/CancelGoal_Request, 1>
        @request.setter
        def request(self, value: _Sequence[_action_msgs_srv.CancelGoal.Request]) -> None: ...
        @property
        def response(self) -> list[_action_msgs_srv.CancelGoal.Response]: ...  # sequence<action_msgs/CancelGoal_Response, 1>
        @response.setter
        def response(self, value: _Sequence[_action_msgs_srv.CancelGoal.Response]) -> None: ...
        def __init__(
            self,
            *,
            info: _service_msgs_msg.ServiceEventInfo = ...,
            request: _Sequence[_action_msgs_srv.CancelGoal.Request] = ...,
            response: _Sequence[_action_msgs_srv.CancelGoal.Response] = ...,
            check_fields: bool = ...,
        ) -> None: ...
        @classmethod
        def get_fields_and_field_types(cls) -> dict[str, str]: ...
        __hash__: _ClassVar[None]  # type: ignore[assignment]

CancelGoal_Event = CancelGoal.Event
CancelGoal_Request = CancelGoal.Request
CancelGoal_Response = CancelGoal.Response

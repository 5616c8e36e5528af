# Made by `actionkit stubs`, which overwrites it.
# fmt: off
# ruff: noqa

import action_msgs.msg as _action_msgs_msg
import action_msgs.srv as _action_msgs_srv
import builtin_interfaces.msg as _builtin_interfaces_msg
import service_msgs.msg as _service_msgs_msg
import test_msgs.action as _test_msgs_action
import test_msgs.msg as _test_msgs_msg
import unique_identifier_msgs.msg as _unique_identifier_msgs_msg
from collections.abc import Sequence as _Sequence
from typing import Any as _Any
from typing import ClassVar as _ClassVar

class NestedMessage:
    class Goal:
        SLOT_TYPES: _ClassVar[tuple[_Any, ...]]
        nested_field_no_pkg: _test_msgs_msg.Builtins  # test_msgs/Builtins
        """goal definition"""
        nested_field: _test_msgs_msg.BasicTypes  # test_msgs/BasicTypes
        nested_different_pkg: _builtin_interfaces_msg.Time  # builtin_interfaces/Time
        def __init__(
            self,
            *,
            nested_field_no_pkg: _test_msgs_msg.Builtins = ...,
            nested_field: _test_msgs_msg.BasicTypes = ...,
            nested_different_pkg: _builtin_interfaces_msg.Time = ...,
            check_fields: bool = ...,
        ) -> None: ...
        @classmethod
        def get_fields_and_field_types(cls) -> dict[str, str]: ...
        __hash__: _ClassVar[None]  # type: ignore[assignment]

    class Result:
        SLOT_TYPES: _ClassVar[tuple[_Any, ...]]
        nested_field_no_pkg: _test_msgs_msg.Builtins  # test_msgs/Builtins
        """result definition"""
        nested_field: _test_msgs_msg.BasicTypes  # test_msgs/BasicTypes
        nested_different_pkg: _builtin_interfaces_msg.Time  # builtin_interfaces/Time
        def __init__(
            self,
            *,
            nested_field_no_pkg: _test_msgs_msg.Builtins = ...,
            nested_field: _test_msgs_msg.BasicTypes = ...,
            nested_different_pkg: _builtin_interfaces_msg.Time = ...,
            check_fields: bool = ...,
        ) -> None: ...
        @classmethod
        def get_fields_and_field_types(cls) -> dict[str, str]: ...
        __hash__: _ClassVar[None]  # type: ignore[assignment]

    class Feedback:
        SLOT_TYPES: _ClassVar[tuple[_Any, ...]]
        nested_field_no_pkg: _test_msgs_msg.Builtins  # test_msgs/Builtins
        """feedback"""
        nested_field: _test_msgs_msg.BasicTypes  # test_msgs/BasicTypes
        nested_different_pkg: _builtin_interfaces_msg.Time  # builtin_interfaces/Time
        def __init__(
            self,
            *,
            nested_field_no_pkg: _test_msgs_msg.Builtins = ...,
            nested_field: _test_msgs_msg.BasicTypes = ...,
            nested_different_pkg: _builtin_interfaces_msg.Time = ...,
            check_fields: bool = ...,
        ) -> None: ...
        @classmethod
        def get_fields_and_field_types(cls) -> dict[str, str]: ...
        __hash__: _ClassVar[None]  # type: ignore[assignment]

    class Impl:
        class SendGoalService:
            class Request:
                SLOT_TYPES: _ClassVar[tuple[_Any, ...]]
                goal_id: _unique_identifier_msgs_msg.UUID  # unique_identifier_msgs/UUID
                goal: _test_msgs_action.NestedMessage.Goal  # test_msgs/NestedMessage_Goal
                def __init__(
                    self,
                    *,
                    goal_id: _unique_identifier_msgs_msg.UUID = ...,
                    goal: _test_msgs_action.NestedMessage.Goal = ...,
                    check_fields: bool = ...,
                ) -> None: ...
                @classmethod
                def get_fields_and_field_types(cls) -> dict[str, str]: ...
                __hash__: _ClassVar[None]  # type: ignore[assignment]

            class Response:
                SLOT_TYPES: _ClassVar[tuple[_Any, ...]]
                accepted: bool  # boolean
                stamp: _builtin_interfaces_msg.Time  # builtin_interfaces/Time
                def __init__(
                    self,
                    *,
                    accepted: bool = ...,
                    stamp: _builtin_interfaces_msg.Time = ...,
                    check_fields: bool = ...,
                ) -> None: ...
                @classmethod
                def get_fields_and_field_types(cls) -> dict[str, str]: ...
                __hash__: _ClassVar[None]  # type: ignore[assignment]

            class Event:
                SLOT_TYPES: _ClassVar[tuple[_Any, ...]]
                info: _service_msgs_msg.ServiceEventInfo  # service_msgs/ServiceEventInfo
                @property
                def request(self) -> list[_test_msgs_action.NestedMessage.Impl.SendGoalService.Request]: ...  # sequence<test_msgs/NestedMessage_SendGoal_Request, 1>
                @request.setter
                def request(self, value: _Sequence[_test_msgs_action.NestedMessage.Impl.SendGoalService.Request]) -> None: ...
                @property
                def response(self) -> list[_test_msgs_action.NestedMessage.Impl.SendGoalService.Response]: ...  # sequence<test_msgs/NestedMessage_SendGoal_Response, 1>
                @response.setter
                def response(self, value: _Sequence[_test_msgs_action.NestedMessage.Impl.SendGoalService.Response]) -> None: ...
                def __init__(
                    self,
                    *,
                    info: _service_msgs_msg.ServiceEventInfo = ...,
                    request: _Sequence[_test_msgs_action.NestedMessage.Impl.SendGoalService.Request] = ...,
                    response: _Sequence[_test_msgs_action.NestedMessage.Impl.SendGoalService.Response] = ...,
                    check_fields: bool = ...,
                ) -> None: ...
                @classmethod
                def get_fields_and_field_types(cls) -> dict[str, str]: ...
                __hash__: _ClassVar[None]  # type: ignore[assignment]

        class GetResultService:
            class Request:
                SLOT_TYPES: _ClassVar[tuple[_Any, ...]]
                goal_id: _unique_identifier_msgs_msg.UUID  # unique_identifier_msgs/UUID
                def __init__(
                    self,
                    *,
                    goal_id: _unique_identifier_msgs_msg.UUID = ...,
                    check_fields: bool = ...,
                ) -> None: ...
                @classmethod
                def get_fields_and_field_types(cls) -> dict[str, str]: ...
                __hash__: _ClassVar[None]  # type: ignore[assignment]

            class Response:
                SLOT_TYPES: _ClassVar[tuple[_Any, ...]]
                status: int  # int8
                result: _test_msgs_action.NestedMessage.Result  # test_msgs/NestedMessage_Result
                def __init__(
                    self,
                    *,
                    status: int = ...,
                    result: _test_msgs_action.NestedMessage.Result = ...,
                    check_fields: bool = ...,
                ) -> None: ...
                @classmethod
                def get_fields_and_field_types(cls) -> dict[str, str]: ...
                __hash__: _ClassVar[None]  # type: ignore[assignment]

            class Event:
                SLOT_TYPES: _ClassVar[tuple[_Any, ...]]
                info: _service_msgs_msg.ServiceEventInfo  # service_msgs/ServiceEventInfo
                @property
                def request(self) -> list[_test_msgs_action.NestedMessage.Impl.GetResultService.Request]: ...  # sequence<test_msgs/NestedMessage_GetResult_Request, 1>
                @request.setter
                def request(self, value: _Sequence[_test_msgs_action.NestedMessage.Impl.GetResultService.Request]) -> None: ...
                @property
                def response(self) -> list[_test_msgs_action.NestedMessage.Impl.GetResultService.Response]: ...  # sequence<test_msgs/NestedMessage_GetResult_Response, 1>
                @response.setter
                def response(self, value: _Sequence[_test_msgs_action.NestedMessage.Impl.GetResultService.Response]) -> None: ...
                def __init__(
                    self,
                    *,
                    info: _service_msgs_msg.ServiceEventInfo = ...,
                    request: _Sequence[_test_msgs_action.NestedMessage.Impl.GetResultService.Request] = ...,
                    response: _Sequence[_test_msgs_action.NestedMessage.Impl.GetResultService.Response] = ...,
                    check_fields: bool = ...,
                ) -> None: ...
                @classmethod
                def get_fields_and_field_types(cls) -> dict[str, str]: ...
                __hash__: _ClassVar[None]  # type: ignore[assignment]

        class FeedbackMessage:
            SLOT_TYPES: _ClassVar[tuple[_Any, ...]]
            goal_id: _unique_identifier_msgs_msg.UUID  # unique_identifier_msgs/UUID
            feedback: _test_msgs_action.NestedMessage.Feedback  # test_msgs/NestedMessage_Feedback
            def __init__(
                self,
                *,
                goal_id: _unique_identifier_msgs_msg.UUID = ...,
                feedback: _test_msgs_action.NestedMessage.Feedback = ...,
                check_fields: bool = ...,
            ) -> None: ...
            @classmethod
            def get_fields_and_field_types(cls) -> dict[str, str]: ...
            __hash__: _ClassVar[None]  # type: ignore[assignment]

        CancelGoalService = _action_msgs_srv.CancelGoal
        GoalStatusMessage = _action_msgs_msg.GoalStatusArray

NestedMessage_GetResult_Event = NestedMessage.Impl.GetResultService.Event
NestedMessage_GetResult_Request = NestedMessage.Impl.GetResultService.Request
NestedMessage_GetResult_Response = NestedMessage.Impl.GetResultService.Response
NestedMessage_SendGoal_Event = NestedMessage.Impl.SendGoalService.Event
NestedMessage_SendGoal_Request = NestedMessage.Impl.SendGoalService.Request
NestedMessage_SendGoal_Response = NestedMessage.Impl.SendGoalService.Response

# Made by `actionkit stubs`, which overwrites it.
# fmt: off
# ruff: noqa

import action_msgs.msg as _action_msgs_msg
import action_msgs.srv as _action_msgs_srv
import builtin_interfaces.msg as _builtin_interfaces_msg
import service_msgs.msg as _service_msgs_msg
import test_msgs.action as _test_msgs_action
import unique_identifier_msgs.msg as _unique_identifier_msgs_msg
from array import array as _array
from collections.abc import Iterable as _Iterable
from collections.abc import Sequence as _Sequence
from typing import Any as _Any
from typing import ClassVar as _ClassVar

class Fibonacci:
    class Goal:
        SLOT_TYPES: _ClassVar[tuple[_Any, ...]]
        order: int  # int32
        """goal definition"""
        def __init__(self, *, order: int = ..., check_fields: bool = ...) -> None: ...
        @classmethod
        def get_fields_and_field_types(cls) -> dict[str, str]: ...
        __hash__: _ClassVar[None]  # type: ignore[assignment]

    class Result:
        SLOT_TYPES: _ClassVar[tuple[_Any, ...]]
        @property
        def sequence(self) -> _array[int]:  # sequence<int32>
            """result definition"""
        @sequence.setter
        def sequence(self, value: _Iterable[int]) -> None: ...
        def __init__(self, *, sequence: _Iterable[int] = ..., check_fields: bool = ...) -> None: ...
        @classmethod
        def get_fields_and_field_types(cls) -> dict[str, str]: ...
        __hash__: _ClassVar[None]  # type: ignore[assignment]

    class Feedback:
        SLOT_TYPES: _ClassVar[tuple[_Any, ...]]
        @property
        def sequence(self) -> _array[int]:  # sequence<int32>
            """feedback"""
        @sequence.setter
        def sequence(self, value: _Iterable[int]) -> None: ...
        def __init__(self, *, sequence: _Iterable[int] = ..., check_fields: bool = ...) -> None: ...
        @classmethod
        def get_fields_and_field_types(cls) -> dict[str, str]: ...
        __hash__: _ClassVar[None]  # type: ignore[assignment]

    class Impl:
        class SendGoalService:
            class Request:
                SLOT_TYPES: _ClassVar[tuple[_Any, ...]]
                goal_id: _unique_identifier_msgs_msg.UUID  # unique_identifier_msgs/UUID
                goal: _test_msgs_action.Fibonacci.Goal  # test_msgs/Fibonacci_Goal
                def __init__(
                    self,
                    *,
                    goal_id: _unique_identifier_msgs_msg.UUID = ...,
                    goal: _test_msgs_action.Fibonacci.Goal = ...,
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
                def request(self) -> list[_test_msgs_action.Fibonacci.Impl.SendGoalService.Request]: ...  # sequence<test_msgs/Fibonacci_SendGoal_Request, 1>
                @request.setter
                def request(self, value: _Sequence[_test_msgs_action.Fibonacci.Impl.SendGoalService.Request]) -> None: ...
                @property
                def response(self) -> list[_test_msgs_action.Fibonacci.Impl.SendGoalService.Response]: ...  # sequence<test_msgs/Fibonacci_SendGoal_Response, 1>
                @response.setter
                def response(self, value: _Sequence[_test_msgs_action.Fibonacci.Impl.SendGoalService.Response]) -> None: ...
                def __init__(
                    self,
                    *,
                    info: _service_msgs_msg.ServiceEventInfo = ...,
                    request: _Sequence[_test_msgs_action.Fibonacci.Impl.SendGoalService.Request] = ...,
                    response: _Sequence[_test_msgs_action.Fibonacci.Impl.SendGoalService.Response] = ...,
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
                result: _test_msgs_action.Fibonacci.Result  # test_msgs/Fibonacci_Result
                def __init__(
                    self,
                    *,
                    status: int = ...,
                    result: _test_msgs_action.Fibonacci.Result = ...,
                    check_fields: bool = ...,
                ) -> None: ...
                @classmethod
                def get_fields_and_field_types(cls) -> dict[str, str]: ...
                __hash__: _ClassVar[None]  # type: ignore[assignment]

            class Event:
                SLOT_TYPES: _ClassVar[tuple[_Any, ...]]
                info: _service_msgs_msg.ServiceEventInfo  # service_msgs/ServiceEventInfo
                @property
                def request(self) -> list[_test_msgs_action.Fibonacci.Impl.GetResultService.Request]: ...  # sequence<test_msgs/Fibonacci_GetResult_Request, 1>
                @request.setter
                def request(self, value: _Sequence[_test_msgs_action.Fibonacci.Impl.GetResultService.Request]) -> None: ...
                @property
                def response(self) -> list[_test_msgs_action.Fibonacci.Impl.GetResultService.Response]: ...  # sequence<test_msgs/Fibonacci_GetResult_Response, 1>
                @response.setter
                def response(self, value: _Sequence[_test_msgs_action.Fibonacci.Impl.GetResultService.Response]) -> None: ...
                def __init__(
                    self,
                    *,
                    info: _service_msgs_msg.ServiceEventInfo = ...,
                    request: _Sequence[_test_msgs_action.Fibonacci.Impl.GetResultService.Request] = ...,
                    response: _Sequence[_test_msgs_action.Fibonacci.Impl.GetResultService.Response] = ...,
                    check_fields: bool = ...,
                ) -> None: ...
                @classmethod
                def get_fields_and_field_types(cls) -> dict[str, str]: ...
                __hash__: _ClassVar[None]  # type: ignore[assignment]

        class FeedbackMessage:
            SLOT_TYPES: _ClassVar[tuple[_Any, ...]]
            goal_id: _unique_identifier_msgs_msg.UUID  # unique_identifier_msgs/UUID
            feedback: _test_msgs_action.Fibonacci.Feedback  # test_msgs/Fibonacci_Feedback
            def __init__(
                self,
                *,
                goal_id: _unique_identifier_msgs_msg.UUID = ...,
                feedback: _test_msgs_action.Fibonacci.Feedback = ...,
                check_fields: bool = ...,
            ) -> None: ...
            @classmethod
            def get_fields_and_field_types(cls) -> dict[str, str]: ...
            __hash__: _ClassVar[None]  # type: ignore[assignment]

        CancelGoalService = _action_msgs_srv.CancelGoal
        GoalStatusMessage = _action_msgs_msg.GoalStatusArray

Fibonacci_GetResult_Event = Fibonacci.Impl.GetResultService.Event
Fibonacci_GetResult_Request = Fibonacci.Impl.GetResultService.Request
Fibonacci_GetResult_Response = Fibonacci.Impl.GetResultService.Response
Fibonacci_SendGoal_Event = Fibonacci.Impl.SendGoalService.Event
Fibonacci_SendGoal_Request = Fibonacci.Impl.SendGoalService.Request
Fibonacci_SendGoal_Response = Fibonacci.Impl.SendGoalService.Response

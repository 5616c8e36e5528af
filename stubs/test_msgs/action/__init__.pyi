from array import array
from collections.abc import Sequence
from typing import Any, ClassVar

from action_msgs.msg import GoalStatusArray
from action_msgs.srv import CancelGoal
from builtin_interfaces.msg import Time
from test_msgs.msg import BasicTypes, Builtins
from unique_identifier_msgs.msg import UUID

class Fibonacci:
    class Goal:
        SLOT_TYPES: ClassVar[tuple[Any, ...]]
        order: int
        def __init__(self, *, order: int = ..., check_fields: bool = ...) -> None: ...
        @classmethod
        def get_fields_and_field_types(cls) -> dict[str, str]: ...

    class Result:
        SLOT_TYPES: ClassVar[tuple[Any, ...]]
        @property
        def sequence(self) -> array[int]: ...
        @sequence.setter
        def sequence(self, value: Sequence[int]) -> None: ...
        def __init__(self, *, sequence: Sequence[int] = ..., check_fields: bool = ...) -> None: ...
        @classmethod
        def get_fields_and_field_types(cls) -> dict[str, str]: ...

    class Feedback:
        SLOT_TYPES: ClassVar[tuple[Any, ...]]
        @property
        def sequence(self) -> array[int]: ...
        @sequence.setter
        def sequence(self, value: Sequence[int]) -> None: ...
        def __init__(self, *, sequence: Sequence[int] = ..., check_fields: bool = ...) -> None: ...
        @classmethod
        def get_fields_and_field_types(cls) -> dict[str, str]: ...

    class Impl:
        class SendGoalService:
            class Request:
                SLOT_TYPES: ClassVar[tuple[Any, ...]]
                goal_id: UUID
                goal: Fibonacci.Goal
                def __init__(
                    self,
                    *,
                    goal_id: UUID = ...,
                    goal: Fibonacci.Goal = ...,
                    check_fields: bool = ...,
                ) -> None: ...
                @classmethod
                def get_fields_and_field_types(cls) -> dict[str, str]: ...

            class Response:
                SLOT_TYPES: ClassVar[tuple[Any, ...]]
                accepted: bool
                stamp: Time
                def __init__(
                    self, *, accepted: bool = ..., stamp: Time = ..., check_fields: bool = ...
                ) -> None: ...
                @classmethod
                def get_fields_and_field_types(cls) -> dict[str, str]: ...

        class GetResultService:
            class Request:
                SLOT_TYPES: ClassVar[tuple[Any, ...]]
                goal_id: UUID
                def __init__(self, *, goal_id: UUID = ..., check_fields: bool = ...) -> None: ...
                @classmethod
                def get_fields_and_field_types(cls) -> dict[str, str]: ...

            class Response:
                SLOT_TYPES: ClassVar[tuple[Any, ...]]
                status: int
                result: Fibonacci.Result
                def __init__(
                    self,
                    *,
                    status: int = ...,
                    result: Fibonacci.Result = ...,
                    check_fields: bool = ...,
                ) -> None: ...
                @classmethod
                def get_fields_and_field_types(cls) -> dict[str, str]: ...

        class FeedbackMessage:
            SLOT_TYPES: ClassVar[tuple[Any, ...]]
            goal_id: UUID
            feedback: Fibonacci.Feedback
            def __init__(
                self,
                *,
                goal_id: UUID = ...,
                feedback: Fibonacci.Feedback = ...,
                check_fields: bool = ...,
            ) -> None: ...
            @classmethod
            def get_fields_and_field_types(cls) -> dict[str, str]: ...

        CancelGoalService = CancelGoal
        GoalStatusMessage = GoalStatusArray

class NestedMessage:
    class Goal:
        SLOT_TYPES: ClassVar[tuple[Any, ...]]
        nested_field_no_pkg: Builtins
        nested_field: BasicTypes
        nested_different_pkg: Time
        def __init__(
            self,
            *,
            nested_field_no_pkg: Builtins = ...,
            nested_field: BasicTypes = ...,
            nested_different_pkg: Time = ...,
            check_fields: bool = ...,
        ) -> None: ...
        @classmethod
        def get_fields_and_field_types(cls) -> dict[str, str]: ...

    class Result:
        SLOT_TYPES: ClassVar[tuple[Any, ...]]
        nested_field_no_pkg: Builtins
        nested_field: BasicTypes
        nested_different_pkg: Time
        def __init__(
            self,
            *,
            nested_field_no_pkg: Builtins = ...,
            nested_field: BasicTypes = ...,
            nested_different_pkg: Time = ...,
            check_fields: bool = ...,
        ) -> None: ...
        @classmethod
        def get_fields_and_field_types(cls) -> dict[str, str]: ...

    class Feedback:
        SLOT_TYPES: ClassVar[tuple[Any, ...]]
        nested_field_no_pkg: Builtins
        nested_field: BasicTypes
        nested_different_pkg: Time
        def __init__(
            self,
            *,
            nested_field_no_pkg: Builtins = ...,
            nested_field: BasicTypes = ...,
            nested_different_pkg: Time = ...,
            check_fields: bool = ...,
        ) -> None: ...
        @classmethod
        def get_fields_and_field_types(cls) -> dict[str, str]: ...

    class Impl:
        class SendGoalService:
            class Request:
                SLOT_TYPES: ClassVar[tuple[Any, ...]]
                goal_id: UUID
                goal: NestedMessage.Goal
                def __init__(
                    self,
                    *,
                    goal_id: UUID = ...,
                    goal: NestedMessage.Goal = ...,
                    check_fields: bool = ...,
                ) -> None: ...
                @classmethod
                def get_fields_and_field_types(cls) -> dict[str, str]: ...

            class Response:
                SLOT_TYPES: ClassVar[tuple[Any, ...]]
                accepted: bool
                stamp: Time
                def __init__(
                    self, *, accepted: bool = ..., stamp: Time = ..., check_fields: bool = ...
                ) -> None: ...
                @classmethod
                def get_fields_and_field_types(cls) -> dict[str, str]: ...

        class GetResultService:
            class Request:
                SLOT_TYPES: ClassVar[tuple[Any, ...]]
                goal_id: UUID
                def __init__(self, *, goal_id: UUID = ..., check_fields: bool = ...) -> None: ...
                @classmethod
                def get_fields_and_field_types(cls) -> dict[str, str]: ...

            class Response:
                SLOT_TYPES: ClassVar[tuple[Any, ...]]
                status: int
                result: NestedMessage.Result
                def __init__(
                    self,
                    *,
                    status: int = ...,
                    result: NestedMessage.Result = ...,
                    check_fields: bool = ...,
                ) -> None: ...
                @classmethod
                def get_fields_and_field_types(cls) -> dict[str, str]: ...

        class FeedbackMessage:
            SLOT_TYPES: ClassVar[tuple[Any, ...]]
            goal_id: UUID
            feedback: NestedMessage.Feedback
            def __init__(
                self,
                *,
                goal_id: UUID = ...,
                feedback: NestedMessage.Feedback = ...,
                check_fields: bool = ...,
            ) -> None: ...
            @classmethod
            def get_fields_and_field_types(cls) -> dict[str, str]: ...

        CancelGoalService = CancelGoal
        GoalStatusMessage = GoalStatusArray

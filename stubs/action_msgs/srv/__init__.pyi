from typing import Any, ClassVar

from action_msgs.msg import GoalInfo

class CancelGoal:
    class Request:
        SLOT_TYPES: ClassVar[tuple[Any, ...]]
        goal_info: GoalInfo
        def __init__(self, *, goal_info: GoalInfo = ..., check_fields: bool = ...) -> None: ...
        @classmethod
        def get_fields_and_field_types(cls) -> dict[str, str]: ...

    class Response:
        ERROR_GOAL_TERMINATED: ClassVar[int]
        ERROR_NONE: ClassVar[int]
        ERROR_REJECTED: ClassVar[int]
        ERROR_UNKNOWN_GOAL_ID: ClassVar[int]
        SLOT_TYPES: ClassVar[tuple[Any, ...]]
        return_code: int
        goals_canceling: list[GoalInfo]
        def __init__(
            self,
            *,
            return_code: int = ...,
            goals_canceling: list[GoalInfo] = ...,
            check_fields: bool = ...,
        ) -> None: ...
        @classmethod
        def get_fields_and_field_types(cls) -> dict[str, str]: ...

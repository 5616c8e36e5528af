from typing import Any, ClassVar

from builtin_interfaces.msg import Time
from unique_identifier_msgs.msg import UUID

class GoalInfo:
    SLOT_TYPES: ClassVar[tuple[Any, ...]]
    goal_id: UUID
    stamp: Time
    def __init__(
        self, *, goal_id: UUID = ..., stamp: Time = ..., check_fields: bool = ...
    ) -> None: ...
    @classmethod
    def get_fields_and_field_types(cls) -> dict[str, str]: ...

class GoalStatus:
    STATUS_ABORTED: ClassVar[int]
    STATUS_ACCEPTED: ClassVar[int]
    STATUS_CANCELED: ClassVar[int]
    STATUS_CANCELING: ClassVar[int]
    STATUS_EXECUTING: ClassVar[int]
    STATUS_SUCCEEDED: ClassVar[int]
    STATUS_UNKNOWN: ClassVar[int]
    SLOT_TYPES: ClassVar[tuple[Any, ...]]
    goal_info: GoalInfo
    status: int
    def __init__(
        self, *, goal_info: GoalInfo = ..., status: int = ..., check_fields: bool = ...
    ) -> None: ...
    @classmethod
    def get_fields_and_field_types(cls) -> dict[str, str]: ...

class GoalStatusArray:
    SLOT_TYPES: ClassVar[tuple[Any, ...]]
    status_list: list[GoalStatus]
    def __init__(
        self, *, status_list: list[GoalStatus] = ..., check_fields: bool = ...
    ) -> None: ...
    @classmethod
    def get_fields_and_field_types(cls) -> dict[str, str]: ...

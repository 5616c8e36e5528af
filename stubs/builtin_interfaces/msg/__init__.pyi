from typing import Any, ClassVar

class Time:
    SLOT_TYPES: ClassVar[tuple[Any, ...]]
    sec: int
    nanosec: int
    def __init__(self, *, sec: int = ..., nanosec: int = ..., check_fields: bool = ...) -> None: ...
    @classmethod
    def get_fields_and_field_types(cls) -> dict[str, str]: ...

class Duration:
    SLOT_TYPES: ClassVar[tuple[Any, ...]]
    sec: int
    nanosec: int
    def __init__(self, *, sec: int = ..., nanosec: int = ..., check_fields: bool = ...) -> None: ...
    @classmethod
    def get_fields_and_field_types(cls) -> dict[str, str]: ...

from typing import Any, ClassVar

from builtin_interfaces.msg import Duration, Time

class BasicTypes:
    SLOT_TYPES: ClassVar[tuple[Any, ...]]
    bool_value: bool
    byte_value: bytes
    char_value: int
    float32_value: float
    float64_value: float
    int8_value: int
    uint8_value: int
    int16_value: int
    uint16_value: int
    int32_value: int
    uint32_value: int
    int64_value: int
    uint64_value: int
    def __init__(
        self,
        *,
        bool_value: bool = ...,
        byte_value: bytes = ...,
        char_value: int = ...,
        float32_value: float = ...,
        float64_value: float = ...,
        int8_value: int = ...,
        uint8_value: int = ...,
        int16_value: int = ...,
        uint16_value: int = ...,
        int32_value: int = ...,
        uint32_value: int = ...,
        int64_value: int = ...,
        uint64_value: int = ...,
        check_fields: bool = ...,
    ) -> None: ...
    @classmethod
    def get_fields_and_field_types(cls) -> dict[str, str]: ...

class Builtins:
    SLOT_TYPES: ClassVar[tuple[Any, ...]]
    duration_value: Duration
    time_value: Time
    def __init__(
        self, *, duration_value: Duration = ..., time_value: Time = ..., check_fields: bool = ...
    ) -> None: ...
    @classmethod
    def get_fields_and_field_types(cls) -> dict[str, str]: ...

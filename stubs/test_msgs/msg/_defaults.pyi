# Made by `actionkit stubs`, which overwrites it.
# fmt: off
# ruff: noqa

from typing import Any as _Any
from typing import ClassVar as _ClassVar

class Defaults:
    BOOL_VALUE__DEFAULT: _ClassVar[bool]
    BYTE_VALUE__DEFAULT: _ClassVar[bytes]
    CHAR_VALUE__DEFAULT: _ClassVar[int]
    FLOAT32_VALUE__DEFAULT: _ClassVar[float]
    FLOAT64_VALUE__DEFAULT: _ClassVar[float]
    INT8_VALUE__DEFAULT: _ClassVar[int]
    UINT8_VALUE__DEFAULT: _ClassVar[int]
    INT16_VALUE__DEFAULT: _ClassVar[int]
    UINT16_VALUE__DEFAULT: _ClassVar[int]
    INT32_VALUE__DEFAULT: _ClassVar[int]
    UINT32_VALUE__DEFAULT: _ClassVar[int]
    INT64_VALUE__DEFAULT: _ClassVar[int]
    UINT64_VALUE__DEFAULT: _ClassVar[int]
    SLOT_TYPES: _ClassVar[tuple[_Any, ...]]
    bool_value: bool  # boolean
    byte_value: bytes  # octet
    char_value: int  # uint8
    float32_value: float  # float
    float64_value: float  # double
    int8_value: int  # int8
    uint8_value: int  # uint8
    int16_value: int  # int16
    uint16_value: int  # uint16
    int32_value: int  # int32
    uint32_value: int  # uint32
    int64_value: int  # int64
    uint64_value: int  # uint64
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
    __hash__: _ClassVar[None]  # type: ignore[assignment]

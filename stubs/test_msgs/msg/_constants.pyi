# Made by `actionkit stubs`, which overwrites it.
# fmt: off
# ruff: noqa

from typing import Any as _Any
from typing import ClassVar as _ClassVar

class Constants:
    """BOOL_CONST = true
    BYTE_CONST = 50
    CHAR_CONST = 100
    FLOAT32_CONST = 1.125
    FLOAT64_CONST = 1.125
    INT8_CONST = -50
    UINT8_CONST = 200
    INT16_CONST = -1000
    UINT16_CONST = 2000
    INT32_CONST = -30000
    UINT32_CONST = 60000
    INT64_CONST = -40000000
    UINT64_CONST = 50000000"""
    BOOL_CONST: _ClassVar[bool] = True
    BYTE_CONST: _ClassVar[bytes] = b'2'
    CHAR_CONST: _ClassVar[int] = 100
    FLOAT32_CONST: _ClassVar[float] = 1.125
    FLOAT64_CONST: _ClassVar[float] = 1.125
    INT16_CONST: _ClassVar[int] = -1000
    INT32_CONST: _ClassVar[int] = -30000
    INT64_CONST: _ClassVar[int] = -40000000
    INT8_CONST: _ClassVar[int] = -50
    UINT16_CONST: _ClassVar[int] = 2000
    UINT32_CONST: _ClassVar[int] = 60000
    UINT64_CONST: _ClassVar[int] = 50000000
    UINT8_CONST: _ClassVar[int] = 200
    SLOT_TYPES: _ClassVar[tuple[_Any, ...]]
    def __init__(self, *, check_fields: bool = ...) -> None: ...
    @classmethod
    def get_fields_and_field_types(cls) -> dict[str, str]: ...
    __hash__: _ClassVar[None]  # type: ignore[assignment]

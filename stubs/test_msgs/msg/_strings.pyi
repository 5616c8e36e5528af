# Made by `actionkit stubs`, which overwrites it.
# fmt: off
# ruff: noqa

from typing import Any as _Any
from typing import ClassVar as _ClassVar

class Strings:
    """STRING_CONST = \"Hello world!\""""
    STRING_CONST: _ClassVar[str] = 'Hello world!'
    STRING_VALUE_DEFAULT1__DEFAULT: _ClassVar[str]
    STRING_VALUE_DEFAULT2__DEFAULT: _ClassVar[str]
    STRING_VALUE_DEFAULT3__DEFAULT: _ClassVar[str]
    STRING_VALUE_DEFAULT4__DEFAULT: _ClassVar[str]
    STRING_VALUE_DEFAULT5__DEFAULT: _ClassVar[str]
    BOUNDED_STRING_VALUE_DEFAULT1__DEFAULT: _ClassVar[str]
    BOUNDED_STRING_VALUE_DEFAULT2__DEFAULT: _ClassVar[str]
    BOUNDED_STRING_VALUE_DEFAULT3__DEFAULT: _ClassVar[str]
    BOUNDED_STRING_VALUE_DEFAULT4__DEFAULT: _ClassVar[str]
    BOUNDED_STRING_VALUE_DEFAULT5__DEFAULT: _ClassVar[str]
    SLOT_TYPES: _ClassVar[tuple[_Any, ...]]
    string_value: str  # string
    string_value_default1: str  # string
    string_value_default2: str  # string
    string_value_default3: str  # string
    string_value_default4: str  # string
    string_value_default5: str  # string
    bounded_string_value: str  # string<22>
    bounded_string_value_default1: str  # string<22>
    bounded_string_value_default2: str  # string<22>
    bounded_string_value_default3: str  # string<22>
    bounded_string_value_default4: str  # string<22>
    bounded_string_value_default5: str  # string<22>
    def __init__(
        self,
        *,
        string_value: str = ...,
        string_value_default1: str = ...,
        string_value_default2: str = ...,
        string_value_default3: str = ...,
        string_value_default4: str = ...,
        string_value_default5: str = ...,
        bounded_string_value: str = ...,
        bounded_string_value_default1: str = ...,
        bounded_string_value_default2: str = ...,
        bounded_string_value_default3: str = ...,
        bounded_string_value_default4: str = ...,
        bounded_string_value_default5: str = ...,
        check_fields: bool = ...,
    ) -> None: ...
    @classmethod
    def get_fields_and_field_types(cls) -> dict[str, str]: ...
    __hash__: _ClassVar[None]  # type: ignore[assignment]

# Made by `actionkit stubs`, which overwrites it.
# fmt: off
# ruff: noqa

from typing import Any as _Any
from typing import ClassVar as _ClassVar

class WStrings:
    WSTRING_VALUE_DEFAULT1__DEFAULT: _ClassVar[str]
    WSTRING_VALUE_DEFAULT2__DEFAULT: _ClassVar[str]
    WSTRING_VALUE_DEFAULT3__DEFAULT: _ClassVar[str]
    SLOT_TYPES: _ClassVar[tuple[_Any, ...]]
    wstring_value: str  # wstring
    wstring_value_default1: str  # wstring
    wstring_value_default2: str  # wstring
    wstring_value_default3: str  # wstring
    @property
    def array_of_wstrings(self) -> list[str]:  # wstring[3]
        """wstring WSTRING_CONST=\"Hello world!\"
        wstring<=22 bounded_wstring_value
        wstring<=22 bounded_wstring_value_default1 \"Hello world!\""""
    @array_of_wstrings.setter
    def array_of_wstrings(self, value: list[str] | tuple[str, ...]) -> None: ...
    @property
    def bounded_sequence_of_wstrings(self) -> list[str]: ...  # sequence<wstring, 3>
    @bounded_sequence_of_wstrings.setter
    def bounded_sequence_of_wstrings(self, value: list[str] | tuple[str, ...]) -> None: ...
    @property
    def unbounded_sequence_of_wstrings(self) -> list[str]: ...  # sequence<wstring>
    @unbounded_sequence_of_wstrings.setter
    def unbounded_sequence_of_wstrings(self, value: list[str] | tuple[str, ...]) -> None: ...
    def __init__(
        self,
        *,
        wstring_value: str = ...,
        wstring_value_default1: str = ...,
        wstring_value_default2: str = ...,
        wstring_value_default3: str = ...,
        array_of_wstrings: list[str] | tuple[str, ...] = ...,
        bounded_sequence_of_wstrings: list[str] | tuple[str, ...] = ...,
        unbounded_sequence_of_wstrings: list[str] | tuple[str, ...] = ...,
        check_fields: bool = ...,
    ) -> None: ...
    @classmethod
    def get_fields_and_field_types(cls) -> dict[str, str]: ...
    __hash__: _ClassVar[None]  # type: ignore[assignment]

# Made by `actionkit stubs`, which overwrites it.
# fmt: off
# ruff: noqa

from collections.abc import Sequence as _Sequence
from numpy import uint8 as _uint8
from numpy.typing import NDArray as _NDArray
from typing import Any as _Any
from typing import ClassVar as _ClassVar

class UUID:
    """A universally unique identifier (UUID).
    http://en.wikipedia.org/wiki/Universally_unique_identifier
    http://tools.ietf.org/html/rfc4122.html"""
    SLOT_TYPES: _ClassVar[tuple[_Any, ...]]
    @property
    def uuid(self) -> _NDArray[_uint8]: ...  # uint8[16]
    @uuid.setter
    def uuid(self, value: _Sequence[int] | _NDArray[_Any]) -> None: ...
    def __init__(
        self,
        *,
        uuid: _Sequence[int] | _NDArray[_Any] = ...,
        check_fields: bool = ...,
    ) -> None: ...
    @classmethod
    def get_fields_and_field_types(cls) -> dict[str, str]: ...
    __hash__: _ClassVar[None]  # type: ignore[assignment]

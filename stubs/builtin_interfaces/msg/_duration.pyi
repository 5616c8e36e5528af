# Made by `actionkit stubs`, which overwrites it.
# fmt: off
# ruff: noqa

from typing import Any as _Any
from typing import ClassVar as _ClassVar

class Duration:
    SLOT_TYPES: _ClassVar[tuple[_Any, ...]]
    sec: int  # int32
    nanosec: int  # uint32
    def __init__(
        self,
        *,
        sec: int = ...,
        nanosec: int = ...,
        check_fields: bool = ...,
    ) -> None: ...
    @classmethod
    def get_fields_and_field_types(cls) -> dict[str, str]: ...
    __hash__: _ClassVar[None]  # type: ignore[assignment]

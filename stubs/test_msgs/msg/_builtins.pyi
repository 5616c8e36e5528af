# Made by `actionkit stubs`, which overwrites it.
# fmt: off
# ruff: noqa

import builtin_interfaces.msg as _builtin_interfaces_msg
from typing import Any as _Any
from typing import ClassVar as _ClassVar

class Builtins:
    SLOT_TYPES: _ClassVar[tuple[_Any, ...]]
    duration_value: _builtin_interfaces_msg.Duration  # builtin_interfaces/Duration
    time_value: _builtin_interfaces_msg.Time  # builtin_interfaces/Time
    def __init__(
        self,
        *,
        duration_value: _builtin_interfaces_msg.Duration = ...,
        time_value: _builtin_interfaces_msg.Time = ...,
        check_fields: bool = ...,
    ) -> None: ...
    @classmethod
    def get_fields_and_field_types(cls) -> dict[str, str]: ...
    __hash__: _ClassVar[None]  # type: ignore[assignment]

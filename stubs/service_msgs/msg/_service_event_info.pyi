# Made by `actionkit stubs`, which overwrites it.
# fmt: off
# ruff: noqa

import builtin_interfaces.msg as _builtin_interfaces_msg
from collections.abc import Sequence as _Sequence
from numpy import uint8 as _uint8
from numpy.typing import NDArray as _NDArray
from typing import Any as _Any
from typing import ClassVar as _ClassVar

class ServiceEventInfo:
    REQUEST_RECEIVED: _ClassVar[int] = 1
    REQUEST_SENT: _ClassVar[int] = 0
    RESPONSE_RECEIVED: _ClassVar[int] = 3
    RESPONSE_SENT: _ClassVar[int] = 2
    SLOT_TYPES: _ClassVar[tuple[_Any, ...]]
    event_type: int  # uint8
    stamp: _builtin_interfaces_msg.Time  # builtin_interfaces/Time
    @property
    def client_gid(self) -> _NDArray[_uint8]: ...  # uint8[16]
    @client_gid.setter
    def client_gid(self, value: _Sequence[int] | _NDArray[_Any]) -> None: ...
    sequence_number: int  # int64
    def __init__(
        self,
        *,
        event_type: int = ...,
        stamp: _builtin_interfaces_msg.Time = ...,
        client_gid: _Sequence[int] | _NDArray[_Any] = ...,
        sequence_number: int = ...,
        check_fields: bool = ...,
    ) -> None: ...
    @classmethod
    def get_fields_and_field_types(cls) -> dict[str, str]: ...
    __hash__: _ClassVar[None]  # type: ignore[assignment]

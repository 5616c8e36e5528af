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
    """REQUEST_SENT = 0
    REQUEST_RECEIVED = 1
    RESPONSE_SENT = 2
    RESPONSE_RECEIVED = 3"""
    REQUEST_RECEIVED: _ClassVar[int] = 1
    REQUEST_SENT: _ClassVar[int] = 0
    RESPONSE_RECEIVED: _ClassVar[int] = 3
    RESPONSE_SENT: _ClassVar[int] = 2
    SLOT_TYPES: _ClassVar[tuple[_Any, ...]]
    event_type: int  # uint8
    """The type of event this message represents"""
    stamp: _builtin_interfaces_msg.Time  # builtin_interfaces/Time
    """Timestamp for when the event occurred (sent or received time)"""
    @property
    def client_gid(self) -> _NDArray[_uint8]:  # uint8[16]
        """Unique identifier for the client that sent the service request
        Note, this is only unique for the current session.
        The size here has to match the size of rmw_dds_common/msg/Gid,
        but unfortunately we cannot use that message directly due to a
        circular dependency."""
    @client_gid.setter
    def client_gid(self, value: _Sequence[int] | _NDArray[_Any]) -> None: ...
    sequence_number: int  # int64
    """Sequence number for the request
    Combined with the client ID, this creates a unique ID for the service transaction"""
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

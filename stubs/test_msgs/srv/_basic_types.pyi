# Made by `actionkit stubs`, which overwrites it.
# fmt: off
# ruff: noqa

import service_msgs.msg as _service_msgs_msg
import test_msgs.srv as _test_msgs_srv
from collections.abc import Sequence as _Sequence
from typing import Any as _Any
from typing import ClassVar as _ClassVar

class BasicTypes:
    class Request:
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
        string_value: str  # string
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
            string_value: str = ...,
            check_fields: bool = ...,
        ) -> None: ...
        @classmethod
        def get_fields_and_field_types(cls) -> dict[str, str]: ...
        __hash__: _ClassVar[None]  # type: ignore[assignment]

    class Response:
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
        string_value: str  # string
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
            string_value: str = ...,
            check_fields: bool = ...,
        ) -> None: ...
        @classmethod
        def get_fields_and_field_types(cls) -> dict[str, str]: ...
        __hash__: _ClassVar[None]  # type: ignore[assignment]

    class Event:
        SLOT_TYPES: _ClassVar[tuple[_Any, ...]]
        info: _service_msgs_msg.ServiceEventInfo  # service_msgs/ServiceEventInfo
        @property
        def request(self) -> list[_test_msgs_srv.BasicTypes.Request]: ...  # sequence<test_msgs/BasicTypes_Request, 1>
        @request.setter
        def request(self, value: _Sequence[_test_msgs_srv.BasicTypes.Request]) -> None: ...
        @property
        def response(self) -> list[_test_msgs_srv.BasicTypes.Response]: ...  # sequence<test_msgs/BasicTypes_Response, 1>
        @response.setter
        def response(self, value: _Sequence[_test_msgs_srv.BasicTypes.Response]) -> None: ...
        def __init__(
            self,
            *,
            info: _service_msgs_msg.ServiceEventInfo = ...,
            request: _Sequence[_test_msgs_srv.BasicTypes.Request] = ...,
            response: _Sequence[_test_msgs_srv.BasicTypes.Response] = ...,
            check_fields: bool = ...,
        ) -> None: ...
        @classmethod
        def get_fields_and_field_types(cls) -> dict[str, str]: ...
        __hash__: _ClassVar[None]  # type: ignore[assignment]

BasicTypes_Event = BasicTypes.Event
BasicTypes_Request = BasicTypes.Request
BasicTypes_Response = BasicTypes.Response

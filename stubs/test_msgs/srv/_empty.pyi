# Made by `actionkit stubs`, which overwrites it.
# fmt: off
# ruff: noqa

import service_msgs.msg as _service_msgs_msg
import test_msgs.srv as _test_msgs_srv
from collections.abc import Sequence as _Sequence
from typing import Any as _Any
from typing import ClassVar as _ClassVar

class Empty:
    class Request:
        SLOT_TYPES: _ClassVar[tuple[_Any, ...]]
        def __init__(self, *, check_fields: bool = ...) -> None: ...
        @classmethod
        def get_fields_and_field_types(cls) -> dict[str, str]: ...
        __hash__: _ClassVar[None]  # type: ignore[assignment]

    class Response:
        SLOT_TYPES: _ClassVar[tuple[_Any, ...]]
        def __init__(self, *, check_fields: bool = ...) -> None: ...
        @classmethod
        def get_fields_and_field_types(cls) -> dict[str, str]: ...
        __hash__: _ClassVar[None]  # type: ignore[assignment]

    class Event:
        SLOT_TYPES: _ClassVar[tuple[_Any, ...]]
        info: _service_msgs_msg.ServiceEventInfo  # service_msgs/ServiceEventInfo
        @property
        def request(self) -> list[_test_msgs_srv.Empty.Request]: ...  # sequence<test_msgs/Empty_Request, 1>
        @request.setter
        def request(self, value: _Sequence[_test_msgs_srv.Empty.Request]) -> None: ...
        @property
        def response(self) -> list[_test_msgs_srv.Empty.Response]: ...  # sequence<test_msgs/Empty_Response, 1>
        @response.setter
        def response(self, value: _Sequence[_test_msgs_srv.Empty.Response]) -> None: ...
        def __init__(
            self,
            *,
            info: _service_msgs_msg.ServiceEventInfo = ...,
            request: _Sequence[_test_msgs_srv.Empty.Request] = ...,
            response: _Sequence[_test_msgs_srv.Empty.Response] = ...,
            check_fields: bool = ...,
        ) -> None: ...
        @classmethod
        def get_fields_and_field_types(cls) -> dict[str, str]: ...
        __hash__: _ClassVar[None]  # type: ignore[assignment]

Empty_Event = Empty.Event
Empty_Request = Empty.Request
Empty_Response = Empty.Response

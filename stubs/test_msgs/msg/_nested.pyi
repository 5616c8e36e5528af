# Made by `actionkit stubs`, which overwrites it.
# fmt: off
# ruff: noqa

import test_msgs.msg as _test_msgs_msg
from typing import Any as _Any
from typing import ClassVar as _ClassVar

class Nested:
    SLOT_TYPES: _ClassVar[tuple[_Any, ...]]
    basic_types_value: _test_msgs_msg.BasicTypes  # test_msgs/BasicTypes
    def __init__(
        self,
        *,
        basic_types_value: _test_msgs_msg.BasicTypes = ...,
        check_fields: bool = ...,
    ) -> None: ...
    @classmethod
    def get_fields_and_field_types(cls) -> dict[str, str]: ...
    __hash__: _ClassVar[None]  # type: ignore[assignment]

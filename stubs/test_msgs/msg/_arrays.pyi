# Made by `actionkit stubs`, which overwrites it.
# fmt: off
# ruff: noqa

import test_msgs.msg as _test_msgs_msg
from collections.abc import Sequence as _Sequence
from numpy import float32 as _float32
from numpy import float64 as _float64
from numpy import int16 as _int16
from numpy import int32 as _int32
from numpy import int64 as _int64
from numpy import int8 as _int8
from numpy import uint16 as _uint16
from numpy import uint32 as _uint32
from numpy import uint64 as _uint64
from numpy import uint8 as _uint8
from numpy.typing import NDArray as _NDArray
from typing import Any as _Any
from typing import ClassVar as _ClassVar

class Arrays:
    BOOL_VALUES_DEFAULT__DEFAULT: _ClassVar[list[bool]]
    BYTE_VALUES_DEFAULT__DEFAULT: _ClassVar[list[bytes]]
    CHAR_VALUES_DEFAULT__DEFAULT: _ClassVar[_NDArray[_uint8]]
    FLOAT32_VALUES_DEFAULT__DEFAULT: _ClassVar[_NDArray[_float32]]
    FLOAT64_VALUES_DEFAULT__DEFAULT: _ClassVar[_NDArray[_float64]]
    INT8_VALUES_DEFAULT__DEFAULT: _ClassVar[_NDArray[_int8]]
    UINT8_VALUES_DEFAULT__DEFAULT: _ClassVar[_NDArray[_uint8]]
    INT16_VALUES_DEFAULT__DEFAULT: _ClassVar[_NDArray[_int16]]
    UINT16_VALUES_DEFAULT__DEFAULT: _ClassVar[_NDArray[_uint16]]
    INT32_VALUES_DEFAULT__DEFAULT: _ClassVar[_NDArray[_int32]]
    UINT32_VALUES_DEFAULT__DEFAULT: _ClassVar[_NDArray[_uint32]]
    INT64_VALUES_DEFAULT__DEFAULT: _ClassVar[_NDArray[_int64]]
    UINT64_VALUES_DEFAULT__DEFAULT: _ClassVar[_NDArray[_uint64]]
    STRING_VALUES_DEFAULT__DEFAULT: _ClassVar[list[str]]
    SLOT_TYPES: _ClassVar[tuple[_Any, ...]]
    @property
    def bool_values(self) -> list[bool]:  # boolean[3]
        """Arrays of different types"""
    @bool_values.setter
    def bool_values(self, value: _Sequence[bool]) -> None: ...
    @property
    def byte_values(self) -> list[bytes]: ...  # octet[3]
    @byte_values.setter
    def byte_values(self, value: _Sequence[bytes]) -> None: ...
    @property
    def char_values(self) -> _NDArray[_uint8]: ...  # uint8[3]
    @char_values.setter
    def char_values(self, value: _Sequence[int] | _NDArray[_Any]) -> None: ...
    @property
    def float32_values(self) -> _NDArray[_float32]: ...  # float[3]
    @float32_values.setter
    def float32_values(self, value: _Sequence[float] | _NDArray[_Any]) -> None: ...
    @property
    def float64_values(self) -> _NDArray[_float64]: ...  # double[3]
    @float64_values.setter
    def float64_values(self, value: _Sequence[float] | _NDArray[_Any]) -> None: ...
    @property
    def int8_values(self) -> _NDArray[_int8]: ...  # int8[3]
    @int8_values.setter
    def int8_values(self, value: _Sequence[int] | _NDArray[_Any]) -> None: ...
    @property
    def uint8_values(self) -> _NDArray[_uint8]: ...  # uint8[3]
    @uint8_values.setter
    def uint8_values(self, value: _Sequence[int] | _NDArray[_Any]) -> None: ...
    @property
    def int16_values(self) -> _NDArray[_int16]: ...  # int16[3]
    @int16_values.setter
    def int16_values(self, value: _Sequence[int] | _NDArray[_Any]) -> None: ...
    @property
    def uint16_values(self) -> _NDArray[_uint16]: ...  # uint16[3]
    @uint16_values.setter
    def uint16_values(self, value: _Sequence[int] | _NDArray[_Any]) -> None: ...
    @property
    def int32_values(self) -> _NDArray[_int32]: ...  # int32[3]
    @int32_values.setter
    def int32_values(self, value: _Sequence[int] | _NDArray[_Any]) -> None: ...
    @property
    def uint32_values(self) -> _NDArray[_uint32]: ...  # uint32[3]
    @uint32_values.setter
    def uint32_values(self, value: _Sequence[int] | _NDArray[_Any]) -> None: ...
    @property
    def int64_values(self) -> _NDArray[_int64]: ...  # int64[3]
    @int64_values.setter
    def int64_values(self, value: _Sequence[int] | _NDArray[_Any]) -> None: ...
    @property
    def uint64_values(self) -> _NDArray[_uint64]: ...  # uint64[3]
    @uint64_values.setter
    def uint64_values(self, value: _Sequence[int] | _NDArray[_Any]) -> None: ...
    @property
    def string_values(self) -> list[str]: ...  # string[3]
    @string_values.setter
    def string_values(self, value: list[str] | tuple[str, ...]) -> None: ...
    @property
    def basic_types_values(self) -> list[_test_msgs_msg.BasicTypes]: ...  # test_msgs/BasicTypes[3]
    @basic_types_values.setter
    def basic_types_values(self, value: _Sequence[_test_msgs_msg.BasicTypes]) -> None: ...
    @property
    def constants_values(self) -> list[_test_msgs_msg.Constants]: ...  # test_msgs/Constants[3]
    @constants_values.setter
    def constants_values(self, value: _Sequence[_test_msgs_msg.Constants]) -> None: ...
    @property
    def defaults_values(self) -> list[_test_msgs_msg.Defaults]: ...  # test_msgs/Defaults[3]
    @defaults_values.setter
    def defaults_values(self, value: _Sequence[_test_msgs_msg.Defaults]) -> None: ...
    @property
    def bool_values_default(self) -> list[bool]: ...  # boolean[3]
    @bool_values_default.setter
    def bool_values_default(self, value: _Sequence[bool]) -> None: ...
    @property
    def byte_values_default(self) -> list[bytes]: ...  # octet[3]
    @byte_values_default.setter
    def byte_values_default(self, value: _Sequence[bytes]) -> None: ...
    @property
    def char_values_default(self) -> _NDArray[_uint8]: ...  # uint8[3]
    @char_values_default.setter
    def char_values_default(self, value: _Sequence[int] | _NDArray[_Any]) -> None: ...
    @property
    def float32_values_default(self) -> _NDArray[_float32]: ...  # float[3]
    @float32_values_default.setter
    def float32_values_default(self, value: _Sequence[float] | _NDArray[_Any]) -> None: ...
    @property
    def float64_values_default(self) -> _NDArray[_float64]: ...  # double[3]
    @float64_values_default.setter
    def float64_values_default(self, value: _Sequence[float] | _NDArray[_Any]) -> None: ...
    @property
    def int8_values_default(self) -> _NDArray[_int8]: ...  # int8[3]
    @int8_values_default.setter
    def int8_values_default(self, value: _Sequence[int] | _NDArray[_Any]) -> None: ...
    @property
    def uint8_values_default(self) -> _NDArray[_uint8]: ...  # uint8[3]
    @uint8_values_default.setter
    def uint8_values_default(self, value: _Sequence[int] | _NDArray[_Any]) -> None: ...
    @property
    def int16_values_default(self) -> _NDArray[_int16]: ...  # int16[3]
    @int16_values_default.setter
    def int16_values_default(self, value: _Sequence[int] | _NDArray[_Any]) -> None: ...
    @property
    def uint16_values_default(self) -> _NDArray[_uint16]: ...  # uint16[3]
    @uint16_values_default.setter
    def uint16_values_default(self, value: _Sequence[int] | _NDArray[_Any]) -> None: ...
    @property
    def int32_values_default(self) -> _NDArray[_int32]: ...  # int32[3]
    @int32_values_default.setter
    def int32_values_default(self, value: _Sequence[int] | _NDArray[_Any]) -> None: ...
    @property
    def uint32_values_default(self) -> _NDArray[_uint32]: ...  # uint32[3]
    @uint32_values_default.setter
    def uint32_values_default(self, value: _Sequence[int] | _NDArray[_Any]) -> None: ...
    @property
    def int64_values_default(self) -> _NDArray[_int64]: ...  # int64[3]
    @int64_values_default.setter
    def int64_values_default(self, value: _Sequence[int] | _NDArray[_Any]) -> None: ...
    @property
    def uint64_values_default(self) -> _NDArray[_uint64]: ...  # uint64[3]
    @uint64_values_default.setter
    def uint64_values_default(self, value: _Sequence[int] | _NDArray[_Any]) -> None: ...
    @property
    def string_values_default(self) -> list[str]: ...  # string[3]
    @string_values_default.setter
    def string_values_default(self, value: list[str] | tuple[str, ...]) -> None: ...
    alignment_check: int  # int32
    """Regression test: check alignment of basic field after an array field is correct"""
    def __init__(
        self,
        *,
        bool_values: _Sequence[bool] = ...,
        byte_values: _Sequence[bytes] = ...,
        char_values: _Sequence[int] | _NDArray[_Any] = ...,
        float32_values: _Sequence[float] | _NDArray[_Any] = ...,
        float64_values: _Sequence[float] | _NDArray[_Any] = ...,
        int8_values: _Sequence[int] | _NDArray[_Any] = ...,
        uint8_values: _Sequence[int] | _NDArray[_Any] = ...,
        int16_values: _Sequence[int] | _NDArray[_Any] = ...,
        uint16_values: _Sequence[int] | _NDArray[_Any] = ...,
        int32_values: _Sequence[int] | _NDArray[_Any] = ...,
        uint32_values: _Sequence[int] | _NDArray[_Any] = ...,
        int64_values: _Sequence[int] | _NDArray[_Any] = ...,
        uint64_values: _Sequence[int] | _NDArray[_Any] = ...,
        string_values: list[str] | tuple[str, ...] = ...,
        basic_types_values: _Sequence[_test_msgs_msg.BasicTypes] = ...,
        constants_values: _Sequence[_test_msgs_msg.Constants] = ...,
        defaults_values: _Sequence[_test_msgs_msg.Defaults] = ...,
        bool_values_default: _Sequence[bool] = ...,
        byte_values_default: _Sequence[bytes] = ...,
        char_values_default: _Sequence[int] | _NDArray[_Any] = ...,
        float32_values_default: _Sequence[float] | _NDArray[_Any] = ...,
        float64_values_default: _Sequence[float] | _NDArray[_Any] = ...,
        int8_values_default: _Sequence[int] | _NDArray[_Any] = ...,
        uint8_values_default: _Sequence[int] | _NDArray[_Any] = ...,
        int16_values_default: _Sequence[int] | _NDArray[_Any] = ...,
        uint16_values_default: _Sequence[int] | _NDArray[_Any] = ...,
        int32_values_default: _Sequence[int] | _NDArray[_Any] = ...,
        uint32_values_default: _Sequence[int] | _NDArray[_Any] = ...,
        int64_values_default: _Sequence[int] | _NDArray[_Any] = ...,
        uint64_values_default: _Sequence[int] | _NDArray[_Any] = ...,
        string_values_default: list[str] | tuple[str, ...] = ...,
        alignment_check: int = ...,
        check_fields: bool = ...,
    ) -> None: ...
    @classmethod
    def get_fields_and_field_types(cls) -> dict[str, str]: ...
    __hash__: _ClassVar[None]  # type: ignore[assignment]

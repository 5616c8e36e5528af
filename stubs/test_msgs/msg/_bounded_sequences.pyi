# Made by `actionkit stubs`, which overwrites it.
# fmt: off
# ruff: noqa

import test_msgs.msg as _test_msgs_msg
from array import array as _array
from collections.abc import Iterable as _Iterable
from collections.abc import Sequence as _Sequence
from typing import Any as _Any
from typing import ClassVar as _ClassVar

class BoundedSequences:
    BOOL_VALUES_DEFAULT__DEFAULT: _ClassVar[list[bool]]
    BYTE_VALUES_DEFAULT__DEFAULT: _ClassVar[list[bytes]]
    CHAR_VALUES_DEFAULT__DEFAULT: _ClassVar[_array[int]]
    FLOAT32_VALUES_DEFAULT__DEFAULT: _ClassVar[_array[float]]
    FLOAT64_VALUES_DEFAULT__DEFAULT: _ClassVar[_array[float]]
    INT8_VALUES_DEFAULT__DEFAULT: _ClassVar[_array[int]]
    UINT8_VALUES_DEFAULT__DEFAULT: _ClassVar[_array[int]]
    INT16_VALUES_DEFAULT__DEFAULT: _ClassVar[_array[int]]
    UINT16_VALUES_DEFAULT__DEFAULT: _ClassVar[_array[int]]
    INT32_VALUES_DEFAULT__DEFAULT: _ClassVar[_array[int]]
    UINT32_VALUES_DEFAULT__DEFAULT: _ClassVar[_array[int]]
    INT64_VALUES_DEFAULT__DEFAULT: _ClassVar[_array[int]]
    UINT64_VALUES_DEFAULT__DEFAULT: _ClassVar[_array[int]]
    STRING_VALUES_DEFAULT__DEFAULT: _ClassVar[list[str]]
    SLOT_TYPES: _ClassVar[tuple[_Any, ...]]
    @property
    def bool_values(self) -> list[bool]:  # sequence<boolean, 3>
        """Bounded sequences of different types"""
    @bool_values.setter
    def bool_values(self, value: _Sequence[bool]) -> None: ...
    @property
    def byte_values(self) -> list[bytes]: ...  # sequence<octet, 3>
    @byte_values.setter
    def byte_values(self, value: _Sequence[bytes]) -> None: ...
    @property
    def char_values(self) -> _array[int]: ...  # sequence<uint8, 3>
    @char_values.setter
    def char_values(self, value: _Iterable[int]) -> None: ...
    @property
    def float32_values(self) -> _array[float]: ...  # sequence<float, 3>
    @float32_values.setter
    def float32_values(self, value: _Iterable[float]) -> None: ...
    @property
    def float64_values(self) -> _array[float]: ...  # sequence<double, 3>
    @float64_values.setter
    def float64_values(self, value: _Iterable[float]) -> None: ...
    @property
    def int8_values(self) -> _array[int]: ...  # sequence<int8, 3>
    @int8_values.setter
    def int8_values(self, value: _Iterable[int]) -> None: ...
    @property
    def uint8_values(self) -> _array[int]: ...  # sequence<uint8, 3>
    @uint8_values.setter
    def uint8_values(self, value: _Iterable[int]) -> None: ...
    @property
    def int16_values(self) -> _array[int]: ...  # sequence<int16, 3>
    @int16_values.setter
    def int16_values(self, value: _Iterable[int]) -> None: ...
    @property
    def uint16_values(self) -> _array[int]: ...  # sequence<uint16, 3>
    @uint16_values.setter
    def uint16_values(self, value: _Iterable[int]) -> None: ...
    @property
    def int32_values(self) -> _array[int]: ...  # sequence<int32, 3>
    @int32_values.setter
    def int32_values(self, value: _Iterable[int]) -> None: ...
    @property
    def uint32_values(self) -> _array[int]: ...  # sequence<uint32, 3>
    @uint32_values.setter
    def uint32_values(self, value: _Iterable[int]) -> None: ...
    @property
    def int64_values(self) -> _array[int]: ...  # sequence<int64, 3>
    @int64_values.setter
    def int64_values(self, value: _Iterable[int]) -> None: ...
    @property
    def uint64_values(self) -> _array[int]: ...  # sequence<uint64, 3>
    @uint64_values.setter
    def uint64_values(self, value: _Iterable[int]) -> None: ...
    @property
    def string_values(self) -> list[str]: ...  # sequence<string, 3>
    @string_values.setter
    def string_values(self, value: list[str] | tuple[str, ...]) -> None: ...
    @property
    def basic_types_values(self) -> list[_test_msgs_msg.BasicTypes]: ...  # sequence<test_msgs/BasicTypes, 3>
    @basic_types_values.setter
    def basic_types_values(self, value: _Sequence[_test_msgs_msg.BasicTypes]) -> None: ...
    @property
    def constants_values(self) -> list[_test_msgs_msg.Constants]: ...  # sequence<test_msgs/Constants, 3>
    @constants_values.setter
    def constants_values(self, value: _Sequence[_test_msgs_msg.Constants]) -> None: ...
    @property
    def defaults_values(self) -> list[_test_msgs_msg.Defaults]: ...  # sequence<test_msgs/Defaults, 3>
    @defaults_values.setter
    def defaults_values(self, value: _Sequence[_test_msgs_msg.Defaults]) -> None: ...
    @property
    def bool_values_default(self) -> list[bool]: ...  # sequence<boolean, 3>
    @bool_values_default.setter
    def bool_values_default(self, value: _Sequence[bool]) -> None: ...
    @property
    def byte_values_default(self) -> list[bytes]: ...  # sequence<octet, 3>
    @byte_values_default.setter
    def byte_values_default(self, value: _Sequence[bytes]) -> None: ...
    @property
    def char_values_default(self) -> _array[int]: ...  # sequence<uint8, 3>
    @char_values_default.setter
    def char_values_default(self, value: _Iterable[int]) -> None: ...
    @property
    def float32_values_default(self) -> _array[float]: ...  # sequence<float, 3>
    @float32_values_default.setter
    def float32_values_default(self, value: _Iterable[float]) -> None: ...
    @property
    def float64_values_default(self) -> _array[float]: ...  # sequence<double, 3>
    @float64_values_default.setter
    def float64_values_default(self, value: _Iterable[float]) -> None: ...
    @property
    def int8_values_default(self) -> _array[int]: ...  # sequence<int8, 3>
    @int8_values_default.setter
    def int8_values_default(self, value: _Iterable[int]) -> None: ...
    @property
    def uint8_values_default(self) -> _array[int]: ...  # sequence<uint8, 3>
    @uint8_values_default.setter
    def uint8_values_default(self, value: _Iterable[int]) -> None: ...
    @property
    def int16_values_default(self) -> _array[int]: ...  # sequence<int16, 3>
    @int16_values_default.setter
    def int16_values_default(self, value: _Iterable[int]) -> None: ...
    @property
    def uint16_values_default(self) -> _array[int]: ...  # sequence<uint16, 3>
    @uint16_values_default.setter
    def uint16_values_default(self, value: _Iterable[int]) -> None: ...
    @property
    def int32_values_default(self) -> _array[int]: ...  # sequence<int32, 3>
    @int32_values_default.setter
    def int32_values_default(self, value: _Iterable[int]) -> None: ...
    @property
    def uint32_values_default(self) -> _array[int]: ...  # sequence<uint32, 3>
    @uint32_values_default.setter
    def uint32_values_default(self, value: _Iterable[int]) -> None: ...
    @property
    def int64_values_default(self) -> _array[int]: ...  # sequence<int64, 3>
    @int64_values_default.setter
    def int64_values_default(self, value: _Iterable[int]) -> None: ...
    @property
    def uint64_values_default(self) -> _array[int]: ...  # sequence<uint64, 3>
    @uint64_values_default.setter
    def uint64_values_default(self, value: _Iterable[int]) -> None: ...
    @property
    def string_values_default(self) -> list[str]: ...  # sequence<string, 3>
    @string_values_default.setter
    def string_values_default(self, value: list[str] | tuple[str, ...]) -> None: ...
    alignment_check: int  # int32
    """Regression test: check alignment of basic field after a sequence field is correct"""
    def __init__(
        self,
        *,
        bool_values: _Sequence[bool] = ...,
        byte_values: _Sequence[bytes] = ...,
        char_values: _Iterable[int] = ...,
        float32_values: _Iterable[float] = ...,
        float64_values: _Iterable[float] = ...,
        int8_values: _Iterable[int] = ...,
        uint8_values: _Iterable[int] = ...,
        int16_values: _Iterable[int] = ...,
        uint16_values: _Iterable[int] = ...,
        int32_values: _Iterable[int] = ...,
        uint32_values: _Iterable[int] = ...,
        int64_values: _Iterable[int] = ...,
        uint64_values: _Iterable[int] = ...,
        string_values: list[str] | tuple[str, ...] = ...,
        basic_types_values: _Sequence[_test_msgs_msg.BasicTypes] = ...,
        constants_values: _Sequence[_test_msgs_msg.Constants] = ...,
        defaults_values: _Sequence[_test_msgs_msg.Defaults] = ...,
        bool_values_default: _Sequence[bool] = ...,
        byte_values_default: _Sequence[bytes] = ...,
        char_values_default: _Iterable[int] = ...,
        float32_values_default: _Iterable[float] = ...,
        float64_values_default: _Iterable[float] = ...,
        int8_values_default: _Iterable[int] = ...,
        uint8_values_default: _Iterable[int] = ...,
        int16_values_default: _Iterable[int] = ...,
        uint16_values_default: _Iterable[int] = ...,
        int32_values_default: _Iterable[int] = ...,
        uint32_values_default: _Iterable[int] = ...,
        int64_values_default: _Iterable[int] = ...,
        uint64_values_default: _Iterable[int] = ...,
        string_values_default: list[str] | tuple[str, ...] = ...,
        alignment_check: int = ...,
        check_fields: bool = ...,
    ) -> None: ...
    @classmethod
    def get_fields_and_field_types(cls) -> dict[str, str]: ...
    __hash__: _ClassVar[None]  # type: ignore[assignment]

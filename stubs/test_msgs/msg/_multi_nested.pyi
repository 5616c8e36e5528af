# Made by `actionkit stubs`, which overwrites it.
# fmt: off
# ruff: noqa

import test_msgs.msg as _test_msgs_msg
from collections.abc import Sequence as _Sequence
from typing import Any as _Any
from typing import ClassVar as _ClassVar

class MultiNested:
    SLOT_TYPES: _ClassVar[tuple[_Any, ...]]
    @property
    def array_of_arrays(self) -> list[_test_msgs_msg.Arrays]:  # test_msgs/Arrays[3]
        """Mulitple levels of nested messages"""
    @array_of_arrays.setter
    def array_of_arrays(self, value: _Sequence[_test_msgs_msg.Arrays]) -> None: ...
    @property
    def array_of_bounded_sequences(self) -> list[_test_msgs_msg.BoundedSequences]: ...  # test_msgs/BoundedSequences[3]
    @array_of_bounded_sequences.setter
    def array_of_bounded_sequences(self, value: _Sequence[_test_msgs_msg.BoundedSequences]) -> None: ...
    @property
    def array_of_unbounded_sequences(self) -> list[_test_msgs_msg.UnboundedSequences]: ...  # test_msgs/UnboundedSequences[3]
    @array_of_unbounded_sequences.setter
    def array_of_unbounded_sequences(self, value: _Sequence[_test_msgs_msg.UnboundedSequences]) -> None: ...
    @property
    def bounded_sequence_of_arrays(self) -> list[_test_msgs_msg.Arrays]: ...  # sequence<test_msgs/Arrays, 3>
    @bounded_sequence_of_arrays.setter
    def bounded_sequence_of_arrays(self, value: _Sequence[_test_msgs_msg.Arrays]) -> None: ...
    @property
    def bounded_sequence_of_bounded_sequences(self) -> list[_test_msgs_msg.BoundedSequences]: ...  # sequence<test_msgs/BoundedSequences, 3>
    @bounded_sequence_of_bounded_sequences.setter
    def bounded_sequence_of_bounded_sequences(self, value: _Sequence[_test_msgs_msg.BoundedSequences]) -> None: ...
    @property
    def bounded_sequence_of_unbounded_sequences(self) -> list[_test_msgs_msg.UnboundedSequences]: ...  # sequence<test_msgs/UnboundedSequences, 3>
    @bounded_sequence_of_unbounded_sequences.setter
    def bounded_sequence_of_unbounded_sequences(self, value: _Sequence[_test_msgs_msg.UnboundedSequences]) -> None: ...
    @property
    def unbounded_sequence_of_arrays(self) -> list[_test_msgs_msg.Arrays]: ...  # sequence<test_msgs/Arrays>
    @unbounded_sequence_of_arrays.setter
    def unbounded_sequence_of_arrays(self, value: _Sequence[_test_msgs_msg.Arrays]) -> None: ...
    @property
    def unbounded_sequence_of_bounded_sequences(self) -> list[_test_msgs_msg.BoundedSequences]: ...  # sequence<test_msgs/BoundedSequences>
    @unbounded_sequence_of_bounded_sequences.setter
    def unbounded_sequence_of_bounded_sequences(self, value: _Sequence[_test_msgs_msg.BoundedSequences]) -> None: ...
    @property
    def unbounded_sequence_of_unbounded_sequences(self) -> list[_test_msgs_msg.UnboundedSequences]: ...  # sequence<test_msgs/UnboundedSequences>
    @unbounded_sequence_of_unbounded_sequences.setter
    def unbounded_sequence_of_unbounded_sequences(self, value: _Sequence[_test_msgs_msg.UnboundedSequences]) -> None: ...
    def __init__(
        self,
        *,
        array_of_arrays: _Sequence[_test_msgs_msg.Arrays] = ...,
        array_of_bounded_sequences: _Sequence[_test_msgs_msg.BoundedSequences] = ...,
        array_of_unbounded_sequences: _Sequence[_test_msgs_msg.UnboundedSequences] = ...,
        bounded_sequence_of_arrays: _Sequence[_test_msgs_msg.Arrays] = ...,
        bounded_sequence_of_bounded_sequences: _Sequence[_test_msgs_msg.BoundedSequences] = ...,
        bounded_sequence_of_unbounded_sequences: _Sequence[_test_msgs_msg.UnboundedSequences] = ...,
        unbounded_sequence_of_arrays: _Sequence[_test_msgs_msg.Arrays] = ...,
        unbounded_sequence_of_bounded_sequences: _Sequence[_test_msgs_msg.BoundedSequences] = ...,
        unbounded_sequence_of_unbounded_sequences: _Sequence[_test_msgs_msg.UnboundedSequences] = ...,
        check_fields: bool = ...,
    ) -> None: ...
    @classmethod
    def get_fields_and_field_types(cls) -> dict[str, str]: ...
    __hash__: _ClassVar[None]  # type: ignore[assignment]

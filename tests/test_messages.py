"""Conversion of fields, with every installed message type, and every kind of wrong value."""

from __future__ import annotations

import enum
import importlib
import itertools
import json
import math
import pickle
import sys
from array import array
from collections import OrderedDict, deque
from collections.abc import Mapping
from fractions import Fraction
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy
import pytest
from geometry_msgs.msg import Point32, Polygon, PoseArray
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rclpy.duration import Duration
from rclpy.serialization import deserialize_message, serialize_message
from rclpy.time import Time
from rosidl_parser import definition
from test_msgs.action import Fibonacci, NestedMessage
from test_msgs.msg import (
    Arrays,
    BasicTypes,
    BoundedPlainSequences,
    BoundedSequences,
    Builtins,
    Defaults,
    Empty,
    MultiNested,
    Nested,
    Strings,
    UnboundedSequences,
    WStrings,
)

from actionkit._messages import convert
from actionkit._messages.convert import from_plain, to_plain
from actionkit._messages.paths import field_type, get_field, type_name
from actionkit._model.field_errors import FieldError, FieldProblem, FieldTypeError, shown
from tests import forked

# rosidl loads its IDL parser with the first type support, and that an old lark
pytestmark = pytest.mark.filterwarnings("ignore:module 'sre_:DeprecationWarning")

INTEGERS = {
    f"{sign}int{bits}": (0, 2**bits - 1) if sign else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
    for sign in ("", "u")
    for bits in (8, 16, 32, 64)
}
FLOAT32_MAX = float(numpy.finfo(numpy.float32).max)


def installed_message_classes() -> list[type]:
    """Every message, goal, result and feedback class of the packages that are installed."""
    found: list[type] = []
    for package in ("test_msgs", "std_msgs", "geometry_msgs", "nav_msgs"):
        for kind in ("msg", "action"):
            try:
                module = importlib.import_module(f"{package}.{kind}")
            except ModuleNotFoundError:
                continue
            for member in vars(module).values():
                if hasattr(member, "SLOT_TYPES") and kind == "msg":
                    found.append(member)
                elif hasattr(member, "Feedback"):
                    found += [member.Goal, member.Result, member.Feedback]
    return found


MESSAGE_CLASSES = installed_message_classes()


# -- messages filled at random, from rosidl's own description and not from the code under test -----


def scalars(name: str) -> st.SearchStrategy[Any]:
    if name in INTEGERS:
        return st.integers(*INTEGERS[name])
    return {
        "boolean": st.booleans(),
        "octet": st.binary(min_size=1, max_size=1),
        # ROS's own check, turned on below, refuses the largest float: its bound is rounded down
        "float": st.floats(width=32).filter(lambda number: abs(number) != FLOAT32_MAX),
        "double": st.floats(),
    }[name]


def values(slot: Any) -> st.SearchStrategy[Any]:
    """Values for a field, in the form in which ROS holds them."""
    if isinstance(slot, definition.NamespacedType):
        return messages(getattr(importlib.import_module(".".join(slot.namespaces)), slot.name))
    if isinstance(slot, definition.AbstractGenericString):
        limit = getattr(slot, "maximum_size", 4)
        # four bytes are the most that a character takes in UTF-8
        return st.text(
            st.characters(codec="utf-8", exclude_characters="\0"), max_size=min(4, limit // 4)
        )
    if isinstance(slot, definition.BasicType):
        return scalars(slot.typename)
    size = getattr(slot, "size", None)
    most = getattr(slot, "maximum_size", 2)
    if isinstance(slot.value_type, definition.NamespacedType):
        most = min(most, 1)  # MultiNested holds arrays of arrays of messages
    return st.lists(values(slot.value_type), min_size=size or 0, max_size=size or most)


_STRATEGIES: dict[type, st.SearchStrategy[Any]] = {}


def messages(cls: Any) -> st.SearchStrategy[Any]:
    if cls not in _STRATEGIES:
        slots = dict(zip(cls.get_fields_and_field_types(), cls.SLOT_TYPES, strict=True))
        fields = {name: values(slot) for name, slot in slots.items()}
        # A few fields at a time: a MultiNested has thousands of values
        some = (
            st.lists(st.sampled_from(sorted(fields)), max_size=4, unique=True) if fields else None
        )

        @st.composite
        def build(draw: st.DrawFn) -> Any:
            message = cls()
            for name in draw(some) if some is not None else ():
                setattr(message, name, draw(fields[name]))
            return message

        _STRATEGIES[cls] = build()
    return _STRATEGIES[cls]


def same(one: Any, other: Any) -> bool:
    """Equality of messages, under which nan equals nan."""
    return type(one) is type(other) and one.__repr__() == other.__repr__()


def everywhere(cls: Any, message: Any) -> list[Any]:
    """The mutable things that a message holds, at any depth."""
    found = [message]
    for name in cls.get_fields_and_field_types():
        value = getattr(message, name)
        if hasattr(value, "SLOT_TYPES"):
            found += everywhere(type(value), value)
        elif isinstance(value, (list, array, numpy.ndarray)):
            found.append(value)
            for item in value if isinstance(value, list) else ():
                if hasattr(item, "SLOT_TYPES"):
                    found += everywhere(type(item), item)
    return found


@pytest.mark.long
@pytest.mark.parametrize("cls", MESSAGE_CLASSES, ids=type_name)
@settings(max_examples=15, deadline=None, suppress_health_check=list(HealthCheck), database=None)
@given(data=st.data())
def test_every_message_type_survives_every_conversion(cls: Any, data: st.DataObject) -> None:
    message = data.draw(messages(cls))
    before = repr(message)

    copy = from_plain(cls, message)
    assert same(copy, message)
    assert repr(message) == before
    mutable = {id(thing) for thing in everywhere(cls, message)}
    assert not mutable & {id(thing) for thing in everywhere(cls, copy)}

    plain = to_plain(message)
    assert same(from_plain(cls, plain), message)
    assert same(from_plain(cls, json.loads(json.dumps(plain))), message)

    assert same(deserialize_message(serialize_message(copy), cls), message)

    checked = cls(check_fields=True)  # ROS's own checks, which are off by default, agree
    for name in cls.get_fields_and_field_types():
        setattr(checked, name, getattr(copy, name))


def test_the_message_types_were_found() -> None:
    names = {type_name(cls) for cls in MESSAGE_CLASSES}
    assert {
        "test_msgs/msg/MultiNested",
        "test_msgs/msg/WStrings",
        "test_msgs/action/NestedMessage_Goal",
        "test_msgs/action/Fibonacci_Result",
        "geometry_msgs/msg/PoseStamped",
        "std_msgs/msg/Header",
    } <= names


@pytest.mark.long
@settings(max_examples=200, deadline=None)
@given(st.floats(), st.floats())
def test_finite_or_not_floats_are_never_changed(single: float, double: float) -> None:
    try:
        message = from_plain(BasicTypes, {"float32_value": single, "float64_value": double})
    except FieldError:
        assert math.isfinite(single)
        assert abs(single) >= FLOAT32_MAX  # itself only under ROS's own checks
        return
    assert repr((message.float32_value, message.float64_value)) == repr((single, double))
    received = deserialize_message(serialize_message(message), BasicTypes)
    assert math.isinf(received.float32_value) == math.isinf(single)


anything = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.integers(-(2**66), 2**66)
    | st.floats()
    | st.text()
    | st.binary()
    | st.just("\0")
    | st.just("\ud800"),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
    max_leaves=6,
)


@pytest.mark.long
@settings(max_examples=300, deadline=None, suppress_health_check=list(HealthCheck))
@given(data=st.data())
def test_whatever_is_given_is_refused_or_can_be_serialised(data: st.DataObject) -> None:
    cls: Any = data.draw(
        st.sampled_from([BasicTypes, Strings, WStrings, Arrays, BoundedSequences, Nested])
    )
    name = data.draw(st.sampled_from(sorted(cls.get_fields_and_field_types())))
    value = data.draw(anything)
    problem = None
    try:
        message = from_plain(cls, {name: value})
    except FieldProblem as caught:
        problem = caught
    if problem is not None:
        assert problem.path.startswith(name)
        assert str(problem).startswith(name)
        return
    received = deserialize_message(serialize_message(message), cls)
    if "float" not in field_type(cls, name):
        assert to_plain(received) == to_plain(message)


# -- what is accepted -----------------------------------------------------------------------------


class Colour(enum.IntEnum):
    RED = 3


class Word(str, enum.Enum):
    HELLO = "hello"


class Metres(float): ...


@pytest.mark.parametrize(
    ("cls", "name", "given_value", "held"),
    [
        (BasicTypes, "int32_value", numpy.int64(7), 7),
        (BasicTypes, "uint8_value", numpy.uint8(255), 255),
        (BasicTypes, "int32_value", Colour.RED, 3),
        (BasicTypes, "char_value", 200, 200),
        (BasicTypes, "float64_value", 5, 5.0),
        (BasicTypes, "float32_value", numpy.float32(0.5), 0.5),
        (BasicTypes, "float64_value", numpy.float64(0.5), 0.5),
        (BasicTypes, "float64_value", numpy.int16(4), 4.0),
        (BasicTypes, "float64_value", Fraction(1, 4), 0.25),
        (BasicTypes, "float32_value", -math.inf, -math.inf),
        (BasicTypes, "float32_value", -FLOAT32_MAX, -FLOAT32_MAX),
        (BasicTypes, "float64_value", sys.float_info.max, sys.float_info.max),
        (BasicTypes, "float64_value", -sys.float_info.max, -sys.float_info.max),
        (BasicTypes, "bool_value", numpy.bool_(True), True),
        (BasicTypes, "byte_value", 255, b"\xff"),
        (BasicTypes, "byte_value", 0, b"\0"),
        (BasicTypes, "byte_value", b"\x01", b"\x01"),
        (BasicTypes, "byte_value", bytearray(b"\x01"), b"\x01"),
        (BasicTypes, "byte_value", numpy.uint8(9), b"\x09"),
        (Strings, "string_value", numpy.str_("grüße \U0001f600"), "grüße \U0001f600"),
        (Strings, "string_value", Word.HELLO, "hello"),
        (Strings, "bounded_string_value", "x" * 22, "x" * 22),
        (Strings, "bounded_string_value", "é" * 11, "é" * 11),
        (WStrings, "wstring_value", "a\0b\U0001f600", "a\0b\U0001f600"),
        (UnboundedSequences, "byte_values", b"\x01\xff", [b"\x01", b"\xff"]),
        (UnboundedSequences, "byte_values", [1, b"\xff"], [b"\x01", b"\xff"]),
        (UnboundedSequences, "uint8_values", b"\x01\xff", array("B", [1, 255])),
        (UnboundedSequences, "uint8_values", bytearray(b"\x02"), array("B", [2])),
        (UnboundedSequences, "int32_values", (1, 2), array("i", [1, 2])),
        (UnboundedSequences, "int32_values", range(3), array("i", [0, 1, 2])),
        (UnboundedSequences, "int32_values", deque([1]), array("i", [1])),
        (UnboundedSequences, "int32_values", array("q", [1, 2]), array("i", [1, 2])),
        (UnboundedSequences, "int32_values", numpy.array([1, 2]), array("i", [1, 2])),
        (
            UnboundedSequences,
            "int32_values",
            numpy.arange(9, dtype=">i4")[::4],
            array("i", [0, 4, 8]),
        ),
        (
            UnboundedSequences,
            "int32_values",
            numpy.arange(9, dtype="i4")[::4],
            array("i", [0, 4, 8]),
        ),
        (UnboundedSequences, "int32_values", numpy.array([]), array("i")),
        (UnboundedSequences, "int32_values", [numpy.int8(1), 2], array("i", [1, 2])),
        (UnboundedSequences, "float64_values", [1, 2.5], array("d", [1.0, 2.5])),
        (UnboundedSequences, "float64_values", numpy.array([1, 2]), array("d", [1.0, 2.0])),
        (
            UnboundedSequences,
            "float32_values",
            [math.inf, -math.inf],
            array("f", [math.inf, -math.inf]),
        ),
        (UnboundedSequences, "float32_values", numpy.array([0.5]), array("f", [0.5])),
        (
            UnboundedSequences,
            "float32_values",
            [FLOAT32_MAX, -FLOAT32_MAX, math.inf, 1],
            array("f", [FLOAT32_MAX, -FLOAT32_MAX, math.inf, 1.0]),
        ),
        (
            UnboundedSequences,
            "float64_values",
            [sys.float_info.max, Fraction(1, 4), -1e300],
            array("d", [sys.float_info.max, 0.25, -1e300]),
        ),
        (UnboundedSequences, "float64_values", numpy.ma.array([0.5]), array("d", [0.5])),
        (UnboundedSequences, "bool_values", numpy.array([True, False]), [True, False]),
        (UnboundedSequences, "string_values", ("a", "b"), ["a", "b"]),
        (UnboundedSequences, "string_values", numpy.array(["a", "b"]), ["a", "b"]),
        (BoundedPlainSequences, "int32_values", [1, 2, 3], array("i", [1, 2, 3])),
    ],
)
@pytest.mark.every
def test_accepted_values(cls: Any, name: str, given_value: Any, held: Any) -> None:
    value = getattr(from_plain(cls, {name: given_value}), name)
    assert value == held
    assert type(value) is type(held)


def test_the_largest_float_is_accepted_unless_ros_itself_refuses_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    value = {"float32_value": FLOAT32_MAX}
    switch = "test_msgs.msg._basic_types.ros_python_check_fields"
    monkeypatch.setattr(switch, "")
    assert from_plain(BasicTypes, value).float32_value == FLOAT32_MAX
    monkeypatch.setattr(switch, "1")
    with pytest.raises(
        FieldError, match=r"^float32_value: 3\.4.* is refused by ROS itself: The"
    ) as caught:
        from_plain(BasicTypes, value)
    assert caught.value.value == FLOAT32_MAX
    with pytest.raises(FieldError, match=r"^basic_types_value\.float32_value: 3\.4"):
        from_plain(Nested, {"basic_types_value": value})


@pytest.mark.parametrize("ros_checks", ["", "1"], ids=["unchecked", "checked"])
def test_fixed_arrays_of_numbers_are_numpy_arrays_of_the_right_type(
    ros_checks: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    # With its checks on, a message keeps the very array that is assigned to it
    monkeypatch.setattr("test_msgs.msg._arrays.ros_python_check_fields", ros_checks)
    for given_value in ([1, 2, 3], array("i", [1, 2, 3]), numpy.array([1, 2, 3])):
        value = from_plain(Arrays, {"int32_values": given_value}).int32_values
        assert isinstance(value, numpy.ndarray)
        assert value.dtype == numpy.int32
        assert value.tolist() == [1, 2, 3]
    for name in (*INTEGERS, "float32", "float64"):
        value = getattr(from_plain(Arrays, {f"{name}_values": [1, 2, 3]}), f"{name}_values")
        # `==` does not tell a `long` from a `long long`, and the C side reads one of them only.
        assert value.dtype.num == numpy.dtype(name).num
        assert value.tolist() == [1, 2, 3]


def test_mappings_of_any_kind_and_messages_inside_of_them() -> None:
    inner = BasicTypes(int32_value=3)
    goal = from_plain(
        NestedMessage.Goal,
        MappingProxyType({"nested_field": inner, "nested_different_pkg": OrderedDict(sec=4)}),
    )
    assert goal.nested_field == inner
    assert goal.nested_field is not inner
    assert goal.nested_different_pkg.sec == 4
    assert goal.nested_different_pkg.nanosec == 0


def test_what_is_left_out_keeps_its_default() -> None:
    assert from_plain(Defaults, {}) == Defaults()
    assert from_plain(Defaults, {"int8_value": 1}).uint8_value == Defaults().uint8_value != 0
    assert from_plain(Empty, {}) == Empty()


@pytest.mark.parametrize("ros_checks", ["", "1"], ids=["unchecked", "checked"])
@pytest.mark.parametrize("kind", [list, array, numpy.ndarray], ids=lambda kind: kind.__name__)
def test_the_message_is_independent_of_what_it_was_built_from(
    kind: type, ros_checks: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    # With its checks on, a message keeps the very array that is assigned to it
    monkeypatch.setattr("test_msgs.action._fibonacci.ros_python_check_fields", ros_checks)
    sequence: Any = [1, 2] if kind is list else array("i", [1, 2])
    if kind is numpy.ndarray:
        sequence = numpy.array(sequence)
    result = from_plain(Fibonacci.Result, {"sequence": sequence})
    sequence[0] = 99
    assert result.sequence.tolist() == [1, 2]


# -- what is refused ------------------------------------------------------------------------------

Refusal = tuple[Any, Any, type[FieldProblem], str, str]

MASKED = numpy.ma.array([0.5, 0.5], mask=[False, True])
OUT_OF_RANGE: list[Refusal] = [
    (
        BasicTypes,
        {f"{name}_value": value},
        FieldError,
        f"{name}_value",
        f"{value} is out of range for {name} ({low}..{high})",
    )
    for name, (low, high) in INTEGERS.items()
    for value in (low - 1, high + 1)
]
OUT_OF_RANGE_INSIDE: list[Refusal] = [
    (
        cls,
        {f"{name}_values": kind([0, value, 0])},
        FieldError,
        f"{name}_values[1]",
        f"{value} is out of range for {name}",
    )
    for name, (low, high) in INTEGERS.items()
    for value in (low - 1, high + 1)
    for cls in (UnboundedSequences, Arrays)
    for kind in (list, lambda items: numpy.array(items, dtype=object))
]
NONE_EVERYWHERE: list[Refusal] = [
    (cls, {name: None}, FieldTypeError, name, "None is not allowed")
    for cls in (BasicTypes, Strings, WStrings, Arrays, UnboundedSequences, Nested)
    for name in cls.get_fields_and_field_types()
]
OTHERS: list[Refusal] = [
    # scalars of a wrong type
    (BasicTypes, {"int32_value": True}, FieldTypeError, "int32_value",
     "True is of type bool, but int32 needs an int."),
    (BasicTypes, {"int32_value": 5.0}, FieldTypeError, "int32_value", "5.0 is of type float"),
    (BasicTypes, {"int32_value": "5"}, FieldTypeError, "int32_value", "'5' is of type str"),
    (BasicTypes, {"int32_value": numpy.bool_(True)}, FieldTypeError, "int32_value", "needs an int"),
    (BasicTypes, {"int32_value": numpy.array(1)}, FieldTypeError, "int32_value", "needs an int"),
    (BasicTypes, {"int32_value": 10**5000}, FieldError, "int32_value", "<int too long to show>"),
    (BasicTypes, {"float64_value": False}, FieldTypeError, "float64_value", "needs a float"),
    (BasicTypes, {"float64_value": "1e3"}, FieldTypeError, "float64_value",
     "'1e3' is of type str, but double needs a float or an int."),
    (BasicTypes, {"bool_value": 1}, FieldTypeError, "bool_value",
     "1 is of type int, but boolean needs a bool (True or False)."),
    (BasicTypes, {"bool_value": "true"}, FieldTypeError, "bool_value", "'true' is of type str"),
    (BasicTypes, {"byte_value": True}, FieldTypeError, "byte_value", "True is of type bool"),
    (BasicTypes, {"byte_value": "a"}, FieldTypeError, "byte_value",
     "'a' is of type str, but octet needs bytes of length 1 or an int 0..255."),
    (BasicTypes, {"char_value": "a"}, FieldTypeError, "char_value", "'a' is of type str"),
    (Strings, {"string_value": 5}, FieldTypeError, "string_value",
     "5 is of type int, but string needs a str."),
    (Strings, {"string_value": b"a"}, FieldTypeError, "string_value", "b'a' is of type bytes"),
    # scalars of a wrong value
    (BasicTypes, {"byte_value": 256}, FieldError, "byte_value",
     "256 is out of range for octet (0..255)."),
    (BasicTypes, {"byte_value": -1}, FieldError, "byte_value", "-1 is out of range for octet"),
    (BasicTypes, {"byte_value": b""}, FieldError, "byte_value", "b'' has 0 bytes"),
    (BasicTypes, {"byte_value": b"ab"}, FieldError, "byte_value",
     "b'ab' has 2 bytes, but octet needs exactly one."),
    (BasicTypes, {"char_value": 256}, FieldError, "char_value", "out of range for uint8"),
    (BasicTypes, {"float32_value": 1e39}, FieldError, "float32_value", "1e+39 is out of range"),
    (BasicTypes, {"float32_value": -1e39}, FieldError, "float32_value", "-1e+39 is out of range"),
    (BasicTypes, {"float32_value": 10**39}, FieldError, "float32_value",
     "1000000000000000000000000000000000000000 is out of range for float "
     "(-3.40282347e+38..3.40282347e+38)."),
    (BasicTypes, {"float64_value": 10**400}, FieldError, "float64_value",
     "1000000000000000000000000000...00000000000000000000000000000 is out of range for double "
     "(-1.79769313e+308..1.79769313e+308)."),
    # strings
    (Strings, {"string_value": "a\0b"}, FieldError, "string_value",
     "'a\\x00b' holds a NUL character, which string cannot; remove it."),
    (Strings, {"string_value": "a\ud800"}, FieldError, "string_value", "lone surrogate at index 1"),
    (WStrings, {"wstring_value": "\udfff"}, FieldError, "wstring_value", "lone surrogate"),
    (Strings, {"bounded_string_value": "x" * 23}, FieldError, "bounded_string_value", "at most 22"),
    (Strings, {"bounded_string_value": "é" * 12}, FieldError, "bounded_string_value",
     "'éééééééééééé' has 24 bytes of UTF-8, but string<22> takes at most 22."),
    # arrays
    (Arrays, {"int32_values": [1, 2]}, FieldError, "int32_values",
     "[1, 2] has 2 elements, but int32[3] takes exactly 3."),
    (Arrays, {"int32_values": [1] * 4}, FieldError, "int32_values", "int32[3] takes exactly 3"),
    (Arrays, {"bool_values": []}, FieldError, "bool_values", "takes exactly 3"),
    (Arrays, {"string_values": ["a"]}, FieldError, "string_values", "takes exactly 3"),
    (Arrays, {"byte_values": b"ab"}, FieldError, "byte_values", "takes exactly 3"),
    (Arrays, {"basic_types_values": [{}]}, FieldError, "basic_types_values", "takes exactly 3"),
    (BoundedSequences, {"int32_values": [1] * 4}, FieldError, "int32_values",
     "[1, 1, 1, 1] has 4 elements, but sequence<int32, 3> takes at most 3."),
    (BoundedSequences, {"string_values": ["a"] * 4}, FieldError, "string_values", "at most 3"),
    (WStrings, {"bounded_sequence_of_wstrings": ["a"] * 4}, FieldError, "bounded_s", "at most 3"),
    (Arrays, {"int32_values": numpy.zeros((3, 1))}, FieldError, "int32_values", "3x1 array"),
    (Builtins, {"duration_value": Duration(seconds=1)}, FieldTypeError, "duration_value",
     "Duration(nanoseconds=1000000000) is of type Duration, but builtin_interfaces/msg/Duration "
     "needs a builtin_interfaces/msg/Duration or a mapping of its fields; give its .to_msg()."),
    (Builtins, {"time_value": Time(seconds=1)}, FieldTypeError, "time_value", "give its .to_msg()"),
    (Builtins, {"time_value": {"nsec": 1}}, FieldError, "time_value.nsec", "mean 'nanosec'?"),
    (Builtins, {"time_value": {"nsecs": 1}}, FieldError, "time_value.nsecs", "mean 'nanosec'?"),
    (Builtins, {"time_value": {"secs": 1}}, FieldError, "time_value.secs", "mean 'sec'?"),
    (PoseArray, {"poses": numpy.zeros((2, 7))}, FieldTypeError, "poses",
     "is a 2x7 array, but this needs a list of geometry_msgs/msg/Pose or of mappings of its"),
    (Arrays, {"int32_values": numpy.array(3)}, FieldError, "int32_values",
     "array(3) is a 0-dimensional array; ROS arrays are flat, give value.ravel()."),
    (
        UnboundedSequences,
        {"float64_values": numpy.ma.array([1.0, 2.0, 3.0], mask=[0, 1, 0])},
        FieldError,
        "float64_values",
        "no value at index 1, which is masked",  # numpy would send 1e+20 there
    ),
    (UnboundedSequences, {"int8_values": b"a"}, FieldTypeError, "int8_values", "b'a' is of type"),
    (UnboundedSequences, {"float32_values": [1, -1e39]}, FieldError, "float32_values[1]", "-1e+39"),
    (UnboundedSequences, {"float32_values": [1, 1e39]}, FieldError, "float32_values[1]", "1e+39"),
    (UnboundedSequences, {"float32_values": [math.inf, 1, -1e39]}, FieldError, "float32_values[2]",
     "-1e+39 is out of range"),
    (UnboundedSequences, {"float32_values": numpy.array([0, 1e39])},
     FieldError, "float32_values[1]", "1e+39 is out of range"),
    (UnboundedSequences, {"float64_values": [0.0, 10**400]}, FieldError, "float64_values[1]",
     "out of range for double"),
    (Fibonacci.Result, {"sequence": [1, True]}, FieldTypeError, "sequence[1]", "True is of type"),
    (Fibonacci.Result, {"sequence": [1, 2.0]}, FieldTypeError, "sequence[1]", "2.0 is of type"),
    (Fibonacci.Result, {"sequence": [1, None]}, FieldTypeError, "sequence[1]",
     "None is not allowed"),
    (Fibonacci.Result, {"sequence": numpy.array([0.5])}, FieldTypeError, "sequence[0]",
     "0.5 is of"),
    (Fibonacci.Result, {"sequence": array("d", [1.0])}, FieldTypeError, "sequence[0]", "1.0 is of"),
    (Fibonacci.Result, {"sequence": numpy.array([True])}, FieldTypeError, "sequence[0]", "True is"),
    (Fibonacci.Result, {"sequence": "12"}, FieldTypeError, "sequence", "'12' is of type str"),
    (Fibonacci.Result, {"sequence": b"12"}, FieldTypeError, "sequence", "b'12' is of type bytes"),
    (Fibonacci.Result, {"sequence": 12}, FieldTypeError, "sequence", "12 is of type int"),
    (Fibonacci.Result, {"sequence": {1, 2}}, FieldTypeError, "sequence", "{1, 2} is of type set"),
    (Fibonacci.Result, {"sequence": iter([1])}, FieldTypeError, "sequence", "needs a list"),
    (Fibonacci.Result, {"sequence": {0: 1}}, FieldTypeError, "sequence", "{0: 1} is of type dict"),
    (UnboundedSequences, {"bool_values": [True, 1]}, FieldTypeError, "bool_values[1]", "1 is of"),
    (UnboundedSequences, {"byte_values": [b"a", 300]}, FieldError, "byte_values[1]", "300 is out"),
    (UnboundedSequences, {"string_values": "abc"}, FieldTypeError, "string_values",
     "'abc' is of type str, but this field needs a list, a tuple or an array."),
    (UnboundedSequences, {"string_values": ["a", "\0"]}, FieldError, "string_values[1]", "NUL"),
    # nested
    (Nested, {"basic_types_value": 3}, FieldTypeError, "basic_types_value", "3 is of type int"),
    (Nested, {"basic_types_value": [3]}, FieldTypeError, "basic_types_value",
     "[3] is of type list"),
    (Nested, {"basic_types_value": Strings()}, FieldTypeError, "basic_types_value",
     "is a test_msgs/msg/Strings, but this needs a test_msgs/msg/BasicTypes"),
    (Nested, {"basic_types_value": BasicTypes(int8_value=128, check_fields=False)},
     FieldError, "basic_types_value.int8_value", "128 is out of range for int8 (-128..127)"),
    (
        MultiNested,
        {"unbounded_sequence_of_arrays": [{}, {"basic_types_values": [{}, {}, {"bool_value": 2}]}]},
        FieldTypeError,
        "unbounded_sequence_of_arrays[1].basic_types_values[2].bool_value",
        "2 is of type int",
    ),
    # names
    (Fibonacci.Goal, {"ordr": 7}, FieldError, "ordr",
     "'ordr'=7 is no field of test_msgs/action/Fibonacci_Goal; did you mean 'order'? Its fields "
     "are: order."),
    (Nested, {"basic_types_value": {"int_32_value": 7}},
     FieldError, "basic_types_value.int_32_value",
     "did you mean 'int32_value'? Its fields are: bool_value, byte_value"),
    (Fibonacci.Goal, {"_order": 7}, FieldError, "_order", "is no field of"),
    (Fibonacci.Goal, {"check_fields": True}, FieldError, "check_fields", "is no field of"),
    (Fibonacci.Goal, {1: 7}, FieldError, "1", "1=7 is no field of"),
    (Empty, {"a": 1}, FieldError, "a",
     "'a'=1 is no field of test_msgs/msg/Empty. It has no fields."),
    # the whole
    (Fibonacci.Goal, Fibonacci.Goal(order=True, check_fields=False), FieldTypeError, "order",
     "True is of type bool"),
    (Fibonacci.Goal, Fibonacci.Goal(order=2**31, check_fields=False), FieldError, "order",
     "2147483648 is out of range"),
    (Fibonacci.Goal, Fibonacci.Result(), FieldTypeError, "",
     "is a test_msgs/action/Fibonacci_Result, but this needs a test_msgs/action/Fibonacci_Goal "
     "or a mapping of its fields"),
    (Fibonacci.Goal, Fibonacci.Goal, FieldTypeError, "",
     "test_msgs/action/Fibonacci_Goal is a class, not a message; call it: Fibonacci_Goal()."),
    (Fibonacci.Goal, None, FieldTypeError, "",
     "None is no test_msgs/action/Fibonacci_Goal; give one, or a mapping of its fields."),
    (Fibonacci.Goal, 5, FieldTypeError, "", "5 is of type int"),
    (Fibonacci.Goal, [("order", 5)], FieldTypeError, "", "is of type list"),
    # and what else is told in full
    (BasicTypes, {"int8_value": None}, FieldTypeError, "int8_value",
     "None is not allowed for int8; give an int, or leave the field out to keep its default."),
    (Strings, {"bounded_string_value": 5}, FieldTypeError, "bounded_string_value",
     "5 is of type int, but string<22> needs a str."),
    (WStrings, {"wstring_value": 5}, FieldTypeError, "wstring_value",
     "5 is of type int, but wstring needs a str."),
    (WStrings, {"wstring_value": "a\udfff"}, FieldError, "wstring_value",
     "'a\\udfff' holds a lone surrogate at index 1, which wstring cannot; remove it."),
    (Arrays, {"int32_values": numpy.zeros((1, 3))}, FieldError, "int32_values",
     "array([[0., 0., 0.]]) is a 1x3 array; ROS arrays are flat, give value.ravel()."),
    (UnboundedSequences, {"float64_values": MASKED}, FieldError, "float64_values",
     "the array has no value at index 1, which is masked; give value.filled(...) with a number "
     "for it, or value.compressed() without it."),
    (UnboundedSequences, {"int32_values": "12"}, FieldTypeError, "int32_values",
     "'12' is of type str, but a sequence of int32 needs a list, a tuple or an array."),
    (UnboundedSequences, {"bool_values": 1}, FieldTypeError, "bool_values",
     "1 is of type int, but a sequence of boolean needs a list, a tuple or an array."),
    (UnboundedSequences, {"byte_values": 1}, FieldTypeError, "byte_values",
     "1 is of type int, but a sequence of octet needs a list, a tuple or an array."),
    (UnboundedSequences, {"basic_types_values": 1}, FieldTypeError, "basic_types_values",
     "1 is of type int, but this field needs a list, a tuple or an array."),
    (Builtins, {"time_value": 5}, FieldTypeError, "time_value",
     "5 is of type int, but builtin_interfaces/msg/Time needs a builtin_interfaces/msg/Time or a "
     "mapping of its fields."),
    (PoseArray, {"poses": numpy.zeros((1, 2))}, FieldTypeError, "poses",
     "array([[0., 0.]]) is a 1x2 array, but this needs a list of geometry_msgs/msg/Pose or of "
     "mappings of its fields."),
    (Polygon, {"points": numpy.zeros((1, 3))}, FieldTypeError, "points",
     "array([[0., 0., 0.]]) is a 1x3 array, but this needs a list of geometry_msgs/msg/Point32 "
     "or of mappings of its fields, such as [{'x': x, 'y': y, 'z': z} for x, y, z in value]."),
    (Fibonacci.Goal, Empty(), FieldTypeError, "",
     "test_msgs.msg.Empty() is a test_msgs/msg/Empty, but this needs a "
     "test_msgs/action/Fibonacci_Goal or a mapping of its fields."),
]  # fmt: skip


@pytest.mark.parametrize(
    ("cls", "value", "error", "path", "text"),
    OUT_OF_RANGE + OUT_OF_RANGE_INSIDE + NONE_EVERYWHERE + OTHERS,
)
@pytest.mark.every
def test_refused_values(
    cls: Any, value: Any, error: type[FieldProblem], path: str, text: str
) -> None:
    with pytest.raises(error) as caught:
        from_plain(cls, value)
    problem = caught.value
    assert problem.path == path or (path == "bounded_s" and problem.path.startswith(path))
    told = f"{problem.path}: {problem.problem}" if path else problem.problem
    if text.endswith("."):
        assert str(problem) == (f"{path}: {text}" if path else text)
    else:
        assert text in str(problem)
    assert str(problem) == (told if told.endswith(".") else f"{told}.")
    assert len(str(problem)) < 1200
    if not path or "which is masked" in told:
        assert problem.value is (value[path] if path else value)
    else:
        assert problem.problem.startswith(shown(problem.value))


def test_the_largest_and_the_smallest_numbers_of_a_type_are_kept() -> None:
    for name, (low, high) in INTEGERS.items():
        for value in (low, high):
            assert (
                getattr(from_plain(BasicTypes, {f"{name}_value": value}), f"{name}_value") == value
            )
        for cls in (UnboundedSequences, Arrays):
            for kind in (list, tuple, lambda items: numpy.array(items, dtype=object)):
                given_value = kind([low, high, numpy.dtype(name).type(high)])
                message = from_plain(cls, {f"{name}_values": given_value})
                assert list(getattr(message, f"{name}_values")) == [low, high, high]


def unlike_msg(*types: Any) -> Any:
    """Return a class like those of messages, with types that only IDL files have."""

    class Message:
        SLOT_TYPES = types

        @classmethod
        def get_fields_and_field_types(cls) -> dict[str, str]:
            return {f"field_{place}": str(each) for place, each in enumerate(types)}

    return Message


WCHAR, LONG_DOUBLE = definition.BasicType("wchar"), definition.BasicType("long double")


def test_a_bounded_wide_string_is_counted_in_16_bit_units() -> None:
    cls = unlike_msg(definition.BoundedWString(3))
    for text in ("\U0001f600a", "äöü", ""):
        assert from_plain(cls, {"field_0": text}).field_0 == text
    with pytest.raises(FieldError) as caught:
        from_plain(cls, {"field_0": "\U0001f600\U0001f600"})
    assert str(caught.value) == (
        "field_0: '\U0001f600\U0001f600' has 4 16-bit units, but wstring<3> takes at most 3."
    )


def test_types_that_only_idl_files_have_are_taken_as_they_are() -> None:
    cls = unlike_msg(WCHAR, LONG_DOUBLE)
    message = from_plain(cls, {"field_0": "ä", "field_1": 1.5})
    assert (message.field_0, message.field_1) == ("ä", 1.5)
    with pytest.raises(FieldTypeError) as caught:
        from_plain(cls, {"field_0": None})
    assert str(caught.value) == (
        "field_0: None is not allowed for this field; give a value, or leave the field out to keep"
        " its default."
    )


def test_the_text_is_the_one_that_the_documentation_shows() -> None:
    with pytest.raises(FieldError) as caught:
        from_plain(Fibonacci.Goal, {"order": 99999999999})
    assert str(caught.value) == (
        "order: 99999999999 is out of range for int32 (-2147483648..2147483647)."
    )
    assert caught.value.value == 99999999999
    assert caught.value.args == ("", 99999999999, caught.value.problem)
    assert isinstance(caught.value, ValueError)
    assert not isinstance(caught.value, TypeError)


def test_a_wrong_type_is_a_type_error() -> None:
    with pytest.raises(TypeError, match="order: 'five'") as caught:
        from_plain(Fibonacci.Goal, {"order": "five"})
    assert not isinstance(caught.value, ValueError)


def test_a_huge_value_is_not_written_out_in_the_error() -> None:
    for value in ("x" * 10**6, list(range(10**6)), 10**300, {"a": "y" * 10**6}):
        with pytest.raises(FieldProblem) as caught:
            from_plain(BasicTypes, {"int32_value": value})
        assert len(str(caught.value)) < 300


@pytest.mark.parametrize("value", [99999999999, lambda: 3, {"a": 1}])
@pytest.mark.every
def test_errors_can_be_pickled_whatever_was_refused(value: object) -> None:
    with pytest.raises(FieldProblem) as caught:
        from_plain(Fibonacci.Goal, {"order": value})
    again = pickle.loads(pickle.dumps(caught.value))
    assert type(again) is type(caught.value)
    assert again.value == (shown(value) if callable(value) else value)
    assert (again.path, again.problem, str(again)) == (
        "order",
        caught.value.problem,
        str(caught.value),
    )


@pytest.mark.parametrize(
    ("cls", "hint"),
    [
        (Fibonacci, "; use Fibonacci.Goal, Fibonacci.Result or Fibonacci.Feedback"),
        (int, ""),
        ("Fibonacci", ""),
    ],
)
@pytest.mark.every
def test_what_is_no_message_class_is_a_type_error(cls: Any, hint: str) -> None:
    with pytest.raises(TypeError) as caught:
        from_plain(cls, {})
    assert str(caught.value) == f"{shown(cls)} is not a ROS message class{hint}"


def test_a_class_that_does_not_describe_each_field_is_refused() -> None:
    cls = unlike_msg(WCHAR, WCHAR)
    cls.SLOT_TYPES = cls.SLOT_TYPES[:1]
    with pytest.raises(ValueError, match="shorter than"):
        from_plain(cls, {"field_0": "a"})


# -- to_plain -------------------------------------------------------------------------------------


def assert_plain(value: object) -> None:
    assert type(value) in {dict, list, int, float, bool, str}
    for item in value.values() if isinstance(value, Mapping) else ():
        assert_plain(item)
    for item in value if isinstance(value, list) else ():
        assert_plain(item)


@pytest.mark.parametrize("cls", MESSAGE_CLASSES, ids=type_name)
def test_to_plain_gives_nothing_but_plain_types(cls: Any) -> None:
    assert_plain(to_plain(cls()))


def test_to_plain_of_bytes_times_and_infinities() -> None:
    message = BasicTypes(byte_value=b"\xff", char_value=65, float64_value=-math.inf)
    plain = to_plain(message)
    assert (plain["byte_value"], plain["char_value"]) == (255, 65)
    assert plain["float64_value"] == -math.inf
    assert to_plain(UnboundedSequences(byte_values=[b"\x01", b"\xff"]))["byte_values"] == [1, 255]
    assert to_plain(NestedMessage.Goal())["nested_different_pkg"] == {"sec": 0, "nanosec": 0}


def test_to_plain_shortens_long_arrays_when_asked() -> None:
    result = Fibonacci.Result(sequence=list(range(1000)))
    assert to_plain(result, max_items=3) == {"sequence": [0, 1, 2, "… 997 more"]}
    assert to_plain(result, max_items=1000) == to_plain(result)
    assert to_plain(Arrays(), max_items=0)["string_values"] == ["… 3 more"]
    assert to_plain(Arrays(), max_items=2)["int32_values"] == [0, 0, "… 1 more"]
    inside = to_plain(MultiNested(), max_items=2)["array_of_arrays"]
    assert [len(inside), inside[2], inside[0]["int32_values"][2]] == [3, "… 1 more", "… 1 more"]


def test_to_plain_shows_messages_that_no_check_has_seen() -> None:
    message = BasicTypes(
        check_fields=False,
        int8_value=numpy.int64(3),
        int16_value=Colour.RED,
        byte_value=b"abc",
        uint8_value=object(),
    )
    message.float64_value = numpy.float64(0.5)
    message.float32_value = Metres(0.25)
    message.bool_value = None
    plain = to_plain(message)
    assert (plain["int8_value"], type(plain["int8_value"])) == (3, int)
    assert type(plain["int16_value"]) is int
    assert type(plain["float64_value"]) is float
    assert (plain["float32_value"], type(plain["float32_value"])) == (0.25, float)
    named = Strings(check_fields=False)
    named.string_value = Word.HELLO
    assert to_plain(named)["string_value"] == "hello"
    assert type(to_plain(named)["string_value"]) is str
    assert plain["byte_value"] == [97, 98, 99]
    assert plain["bool_value"] is None
    assert plain["uint8_value"].startswith("<object object")


@pytest.mark.parametrize("value", [None, 3, [Empty()], {"a": 1}, Fibonacci])
def test_to_plain_refuses_what_is_no_message(value: object) -> None:
    with pytest.raises(TypeError) as caught:
        to_plain(value)
    assert str(caught.value) == f"{shown(value)} is not a ROS message"


# -- paths ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("cls", "path", "ros_type"),
    [
        (Fibonacci.Goal, "order", "int32"),
        (Fibonacci.Result, "sequence", "sequence<int32>"),
        (Fibonacci.Result, "sequence[7]", "int32"),
        (Fibonacci.Result, "sequence[0]", "int32"),
        (NestedMessage.Goal, "nested_different_pkg", "builtin_interfaces/Time"),
        (NestedMessage.Goal, "nested_different_pkg.sec", "int32"),
        (Arrays, "int32_values[2]", "int32"),
        (Arrays, "basic_types_values[1].float32_value", "float"),
        (BoundedSequences, "string_values[2]", "string"),
        (Strings, "bounded_string_value", "string<22>"),
        (
            MultiNested,
            "bounded_sequence_of_unbounded_sequences[0].basic_types_values[9].bool_value",
            "boolean",
        ),
    ],
)
@pytest.mark.every
def test_field_type(cls: type, path: str, ros_type: str) -> None:
    assert field_type(cls, path) == ros_type


LOOKS = "a path looks like pose.position.x or poses[0].header."
BASIC_FIELDS = ", ".join(BasicTypes.get_fields_and_field_types())


NOWHERE = [
    (Fibonacci.Result, "sequense", "sequense", "sequense",
     "'sequense' is no field of test_msgs/action/Fibonacci_Result; did you mean 'sequence'? Its "
     "fields are: sequence."),
    (Fibonacci.Result, "zzz", "zzz", "zzz",
     "'zzz' is no field of test_msgs/action/Fibonacci_Result. Its fields are: sequence."),
    (UnboundedSequences, "basic_types_values[0].x", "basic_types_values[0].x", "x",
     f"'x' is no field of test_msgs/msg/BasicTypes. Its fields are: {BASIC_FIELDS}."),
    (Fibonacci.Goal, "order.x", "order.x", "x", "order is of type int32 and has no field 'x'."),
    (Fibonacci.Goal, "order[0]", "order", 0, "it is of type int32, no array; leave out the [0]."),
    (Fibonacci.Result, "sequence.x", "sequence.x", "x",
     "sequence is of type sequence<int32> and has no field 'x'."),
    (Arrays, "int32_values[3]", "int32_values", 3, "there is never an element 3 in a int32[3]."),
    (BoundedSequences, "int32_values[3]", "int32_values", 3,
     "there is never an element 3 in a sequence<int32, 3>."),
    (Fibonacci.Result, "", "", "", f"'' is not a field name in ''; {LOOKS}"),
    (Fibonacci.Result, "sequence[-1]", "sequence[-1]", "sequence[-1]",
     f"'sequence[-1]' is not a field name in 'sequence[-1]'; {LOOKS}"),
    (Nested, "basic_types_value.", "basic_types_value.", "basic_types_value.",
     f"'' is not a field name in 'basic_types_value.'; {LOOKS}"),
]  # fmt: skip


@pytest.mark.parametrize(("cls", "path", "where", "wrong", "text"), NOWHERE)
@pytest.mark.every
def test_paths_that_lead_nowhere(cls: Any, path: str, where: str, wrong: object, text: str) -> None:
    for resolve in (lambda: field_type(cls, path), lambda: get_field(cls(), path)):
        with pytest.raises(FieldError) as caught:
            resolve()
        assert str(caught.value) == (f"{where}: {text}" if where else text)
        assert (caught.value.path, caught.value.value) == (where, wrong)


def test_get_field() -> None:
    message = Nested(basic_types_value=BasicTypes(int32_value=4))
    assert get_field(message, "basic_types_value.int32_value") == 4
    assert get_field(message, "basic_types_value") is message.basic_types_value
    arrays = UnboundedSequences(basic_types_values=[BasicTypes(), BasicTypes(uint8_value=9)])
    assert get_field(arrays, "basic_types_values[1].uint8_value") == 9
    assert get_field(Arrays(), "int32_values[0]") == 0
    with pytest.raises(FieldError) as caught:
        get_field(arrays, "basic_types_values[2].uint8_value")
    assert str(caught.value) == "basic_types_values: there is no element 2 in an array of 2."
    assert (caught.value.path, caught.value.value) == ("basic_types_values", 2)
    with pytest.raises(TypeError, match="not a ROS message class"):
        get_field({"a": 1}, "a")


# -- its cost -------------------------------------------------------------------------------------


def test_nothing_of_ros_is_loaded_by_the_import() -> None:
    # Without the package's own __init__, which imports much else
    code = (
        "import sys, types;"
        "package = sys.modules['actionkit'] = types.ModuleType('actionkit');"
        "package.__path__ = [sys.argv[1]];"
        "import actionkit._messages.convert;"
        "print([name for name in sys.modules"
        " if name.startswith(('rosidl', 'rclpy', 'rpyutils', 'numpy'))])"
    )
    package = str(Path(convert.__file__).parent.parent)
    command = [sys.executable, "-c", code, package]
    done = forked.run(command, capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"


class Untouchable(array):  # type: ignore[type-arg]
    """An array that must be copied as a whole."""

    def __iter__(self) -> Any:
        raise AssertionError("walked through element by element")


class UntouchableVector(numpy.ndarray):  # type: ignore[type-arg]
    """The same of numpy's."""

    def tolist(self) -> Any:
        raise AssertionError("walked through element by element")


def test_arrays_of_the_right_type_are_not_walked_through() -> None:
    big = Untouchable("i", [1, 2, 3])
    assert from_plain(Fibonacci.Result, {"sequence": big}).sequence.tolist() == [1, 2, 3]
    for name in (*INTEGERS, "float32", "float64"):
        vector = numpy.array([1, 2, 3], dtype=name).view(UntouchableVector)
        message = from_plain(UnboundedSequences, {f"{name}_values": vector})
        assert list(getattr(message, f"{name}_values")) == [1, 2, 3]


def test_the_bytes_of_an_array_are_not_taken_for_those_of_another_type() -> None:
    names = (*INTEGERS, "float32", "float64")
    for name, other, number in itertools.product(names, names, (3, -3, 2**31, 0.5)):
        vector = numpy.array([number]).astype(other)
        if vector[0] != number:
            continue
        low, high = INTEGERS.get(name, (-math.inf, math.inf))
        if low <= number <= high and not (name in INTEGERS and other.startswith("float")):
            message = from_plain(UnboundedSequences, {f"{name}_values": vector})
            assert list(getattr(message, f"{name}_values")) == [number]
        else:
            with pytest.raises(FieldProblem, match=rf"^{name}_values\[0\]: "):
                from_plain(UnboundedSequences, {f"{name}_values": vector})


@pytest.mark.parametrize("dtype", ["float32", "float64", "int64"])
def test_a_table_of_numbers_is_not_a_list_of_messages_and_the_hint_makes_it_one(dtype: str) -> None:
    value = numpy.arange(6, dtype=dtype).reshape(2, 3)
    with pytest.raises(FieldTypeError) as caught:
        from_plain(Polygon, {"points": value})
    text = str(caught.value)
    assert "is a 2x3 array, but this needs a list of geometry_msgs/msg/Point32 or of" in text
    hint = text.partition(", such as ")[2].removesuffix(".")
    points = eval(hint, {"value": value})
    assert from_plain(Polygon, {"points": points}).points[1] == Point32(x=3.0, y=4.0, z=5.0)
    with pytest.raises(FieldTypeError) as caught:
        from_plain(Polygon, {"points": value.reshape(3, 2)})
    assert "such as" not in str(caught.value)

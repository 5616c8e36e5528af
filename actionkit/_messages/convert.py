"""Converts plain Python values to ROS messages and back; no other module does this.

Message classes are arguments, so this module imports nothing of ROS. The converter for a class is
made once, from the class's own description (`SLOT_TYPES`), and kept.
"""

from __future__ import annotations

import importlib
from array import array
from collections.abc import Callable, Iterable, Mapping
from functools import cache
from typing import TYPE_CHECKING, Any, TypeVar

from actionkit._messages.paths import (
    is_message_class,
    message_class,
    slots_of,
    type_name,
    unknown_field,
)
from actionkit._messages.types import (
    NUMERIC_CODES,
    Converter,
    boolean,
    booleans,
    each,
    floating,
    integer,
    items_of,
    numbers,
    octet,
    octets,
    string,
    unchecked,
)
from actionkit._model.field_errors import (
    FieldError,
    FieldProblem,
    FieldTypeError,
    shown,
    wrong_type,
)

if TYPE_CHECKING:
    from rosidl_parser.definition import AbstractNestedType, AbstractType

MessageT = TypeVar("MessageT")

_PLAIN = {bool, int, float, str, type(None)}


def from_plain(cls: type[MessageT], value: MessageT | Mapping[str, Any]) -> MessageT:
    """Build a new, fully checked message from plain Python values, such as JSON values.

        goal = from_plain(Fibonacci.Goal, {"order": 5})

    The message shares nothing mutable with `value`. A client's `call` converts its goal in the same
    way.

    Args:
        cls: The message class, such as `Fibonacci.Goal`.
        value: A message of that class, or a mapping of field names to values. Values may be nested
            mappings, messages, lists, tuples, `array.array`, numpy arrays and scalars; bytes for
            `uint8[]` and `byte[]`; an int for a float field. Missing fields keep their defaults.

    Returns:
        A message that can be serialised. It equals `value` if that is a message.

    Raises:
        FieldTypeError: `value`, or a value in it, has the wrong type. None and bools are not
            numbers.
        FieldError: A number is out of range, a length is wrong, ROS cannot carry a string, or a
            field does not exist.
        TypeError: `cls` is not a message class.
    """
    described: Any = cls  # mypy does not take `type[MessageT]` for hashable
    convert = _converter(described)
    if value is None:
        name = type_name(cls)
        raise FieldTypeError("", None, f"None is no {name}; give one, or a mapping of its fields")
    return convert(value)  # type: ignore[no-any-return]


def to_plain(message: object, *, max_items: int | None = None) -> dict[str, Any]:
    """Turn a message into nested dicts and lists of plain Python values, for YAML and JSON.

        answer = to_plain(client.call({"order": 3}, timeout=10.0))  # {"sequence": [0, 1, 1, 2]}

    Times stay `{sec, nanosec}`, a `byte` becomes an int, arrays become lists, nan and the
    infinities stay floats. It also converts messages that `from_plain` would refuse, because logs
    must be able to show them.

    Args:
        message: Any ROS message.
        max_items: For logs. Each array is cut after this many elements. A str at its end says how
            many more there were. `from_plain` does not accept such a result.

    Returns:
        A dict of field names and values. `from_plain` turns it into an equal message.

    Raises:
        TypeError: `message` is not a ROS message.
    """
    plain = _plain(message, max_items)
    if isinstance(plain, dict):
        return plain
    raise TypeError(f"{shown(message)} is not a ROS message")


@cache
def _converter(cls: type) -> Converter:
    """Make the converter for a message class, and with it those of all messages inside it."""
    fields = {name: _field_converter(slot, text) for name, (slot, text) in slots_of(cls).items()}
    ros_type = type_name(cls)

    def build(items: Iterable[tuple[Any, Any]]) -> Any:
        message = cls()
        for name, item in items:
            convert = fields.get(name)
            if convert is None:
                raise unknown_field(str(name), name, list(fields), ros_type, f"={shown(item)}")
            try:
                converted = convert(item)
            except FieldProblem as problem:
                problem.add_parent(name)
                raise
            try:
                setattr(message, name, converted)
            except AssertionError as error:
                # One of ROS's own checks, which ROS_PYTHON_CHECK_FIELDS=1 turns on. They are laxer
                # than ours, except for the very largest float: their bound is rounded down.
                problem_text = f"{shown(item)} is refused by ROS itself: {error}"
                raise FieldError(name, item, problem_text) from error
        return message

    def convert(value: Any) -> Any:
        if isinstance(value, cls):
            return build([(name, getattr(value, name)) for name in fields])
        if isinstance(value, Mapping):
            return build(value.items())
        needed = f"a {ros_type} or a mapping of its fields"
        if is_message_class(type(value)):
            problem = f"{shown(value)} is a {type_name(type(value))}, but this needs {needed}"
            raise FieldTypeError("", value, problem)
        if is_message_class(value):
            problem = f"{type_name(value)} is a class, not a message; call it: {value.__name__}()"
            raise FieldTypeError("", value, problem)
        if hasattr(value, "to_msg"):  # a Time or a Duration of rclpy's
            needed += "; give its .to_msg()"
        raise wrong_type(value, ros_type, needed)

    return convert


def _field_converter(slot: AbstractType, text: str) -> Converter:
    """Make the converter for a field from its type as rosidl describes it and as ROS writes it."""
    from rosidl_parser.definition import AbstractNestedType

    if isinstance(slot, AbstractNestedType):
        return _sized(slot, text, _elements_converter(slot))
    return _element_converter(slot)


def _element_converter(slot: AbstractType) -> Converter:
    """Make the converter for a value that is not an array."""
    from rosidl_parser.definition import AbstractGenericString, AbstractWString, NamespacedType

    if isinstance(slot, NamespacedType):
        return _converter(message_class(slot))
    if isinstance(slot, AbstractGenericString):
        wide = isinstance(slot, AbstractWString)
        return string(getattr(slot, "maximum_size", None), wide)
    name: str = getattr(slot, "typename", "")
    if name in ("float", "double"):
        return floating(name)
    if name in NUMERIC_CODES:
        return integer(name)
    return {"boolean": boolean, "octet": octet}.get(name, unchecked)


def _elements_converter(slot: AbstractNestedType) -> Converter:
    """Make the converter for an array, in the container that the message's C side wants."""
    from rosidl_parser.definition import Array, NamespacedType

    name: str = getattr(slot.value_type, "typename", "")
    if name in NUMERIC_CODES:
        convert = numbers(name)
        if not isinstance(slot, Array):
            return convert
        # Fixed-length arrays of numbers are numpy arrays, the only thing their C side can read.
        numpy: Any = importlib.import_module("numpy")
        dtype = {"float": "float32", "double": "float64"}.get(name, name)
        return lambda value: numpy.array(convert(value), dtype=dtype)
    if name in ("boolean", "octet"):
        return booleans if name == "boolean" else octets
    element = _element_converter(slot.value_type)
    if isinstance(slot.value_type, NamespacedType):
        return _messages(message_class(slot.value_type), element)
    return lambda value: each(element, items_of(value, "this field"))


def _messages(cls: type, element: Converter) -> Converter:
    """Make the converter for an array of messages; its error has a hint for a table of numbers."""
    slots = slots_of(cls)
    numeric = all(getattr(slot, "typename", "") in NUMERIC_CODES for slot, _ in slots.values())

    def convert(value: Any) -> list[Any]:
        if getattr(value, "ndim", 1) != 2:
            return each(element, items_of(value, "this field"))
        fit = numeric and value.shape[1] == len(slots)
        pairs = ", ".join(f"{name!r}: {name}" for name in slots)
        how = f", such as [{{{pairs}}} for {', '.join(slots)} in value]" if fit else ""
        shape = "x".join(map(str, value.shape))
        problem = (
            f"{shown(value)} is a {shape} array, but this needs a list of {type_name(cls)} or of"
            f" mappings of its fields{how}"
        )
        raise FieldTypeError("", value, problem)

    return convert


def _sized(slot: AbstractNestedType, text: str, convert: Converter) -> Converter:
    """Add the check of an array's length to its converter."""
    exact: int | None = getattr(slot, "size", None)
    most: int | None = getattr(slot, "maximum_size", None)
    if exact is None and most is None:
        return convert

    def convert_sized(value: Any) -> Any:
        result = convert(value)
        count = len(result)
        if count == exact or (most is not None and count <= most):
            return result
        allowed = f"exactly {exact}" if exact is not None else f"at most {most}"
        problem = f"{shown(value)} has {count} elements, but {text} takes {allowed}"
        raise FieldError("", value, problem)

    return convert_sized


def _plain(value: Any, max_items: int | None) -> Any:
    # By the value, not by the field's type: a message that was never checked must work, too.
    cls: Any = type(value)
    if cls in _PLAIN:
        return value
    if is_message_class(cls):
        return {name: _plain(getattr(value, name), max_items) for name in slots_of(cls)}
    if isinstance(value, (bytes, bytearray)) and len(value) == 1:
        return value[0]
    if isinstance(value, (list, tuple, array, bytes, bytearray)) or hasattr(value, "tolist"):
        return _plain_items(value, max_items)
    if isinstance(value, (int, float)):  # mostly the members of enumerations
        return int(value) if isinstance(value, int) else float(value)
    return str.__str__(value) if isinstance(value, str) else shown(value)


def _plain_items(value: Any, max_items: int | None) -> Any:
    if not getattr(value, "shape", True):
        return value.tolist()  # numpy's scalars have that method too
    count = len(value)
    kept = value if max_items is None or count <= max_items else value[:max_items]
    to_list: Callable[[], list[Any]] | None = getattr(kept, "tolist", None)
    items = to_list() if to_list else [_plain(item, max_items) for item in kept]
    if len(kept) < count:
        items.append(f"… {count - len(kept)} more")
    return items

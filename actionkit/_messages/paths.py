"""Finds the fields of a message class, and a single field by its dotted path."""

from __future__ import annotations

import hashlib
import importlib
import re
from collections.abc import Mapping, Sequence
from functools import cache, lru_cache
from typing import TYPE_CHECKING, Any

from actionkit._model.field_errors import FieldError, shown
from actionkit._model.similar_names import similar_names

if TYPE_CHECKING:
    from rosidl_parser.definition import AbstractType

_ROS_1 = {"nsec": "nanosec", "nsecs": "nanosec"}
"""Names of ROS 1 -> the field that is meant. By its letters, `sec` would be more similar."""
_PATH_PART = re.compile(r"([A-Za-z_]\w*)(?:\[(\d+)\])?")


def field_type(cls: type, path: str) -> str:
    """Return the ROS type of a field, as the message class writes it: `int32`, `sequence<…>`.

    A path is dotted, with indices: `error_code`, `pose.position.x`, `poses[0].header`.

    Raises:
        FieldError: There is no such field; the text names the existing fields.
        TypeError: `cls` is not a message class.
    """
    return _resolve(cls, path)[1]


def get_field(message: object, path: str) -> Any:
    """Return the value of a field, not converted; `path` is as for `field_type`.

    Raises:
        FieldError: There is no such field, or an array is too short for an index of the path.
        TypeError: `message` is not a ROS message.
    """
    value: Any = message
    cls: Any = type(message)
    for name, index, upto in _resolve(cls, path)[0]:
        value = getattr(value, name)
        if index is None:
            continue
        if index >= len(value):
            problem = f"there is no element {index} in an array of {len(value)}"
            raise FieldError(upto, index, problem)
        value = value[index]
    return value


def type_name(cls: type) -> str:
    """Return the name that ROS gives a message class: `test_msgs/action/Fibonacci_Goal`."""
    package, *middle = cls.__module__.split(".")
    # The class is defined in a private module of its own: test_msgs.action._fibonacci
    return "/".join([package, *(part for part in middle if not part.startswith("_")), cls.__name__])


def is_message_class(cls: object) -> bool:
    """Return whether this is a class that rosidl generated for a message."""
    return isinstance(cls, type) and hasattr(cls, "SLOT_TYPES")


@cache
def slots_of(cls: type) -> Mapping[str, tuple[AbstractType, str]]:
    """Return each field's type, as rosidl describes it and as ROS writes it."""
    if not is_message_class(cls):
        hint = ""
        if hasattr(cls, "Goal"):
            hint = f"; use {cls.__name__}.Goal, {cls.__name__}.Result or {cls.__name__}.Feedback"
        raise TypeError(f"{shown(cls)} is not a ROS message class{hint}")
    described: Any = cls
    texts = described.get_fields_and_field_types()
    return {
        name: (slot, text)
        for (name, text), slot in zip(texts.items(), described.SLOT_TYPES, strict=True)
    }


def message_class(slot: Any) -> type:
    """Return the Python class of a field's `NamespacedType`."""
    module = importlib.import_module(".".join(slot.namespaces))
    return getattr(module, slot.name)  # type: ignore[no-any-return]


@cache
def layout_of(*classes: type) -> str:
    """Return the names and types of all fields of message classes, as a hash."""
    texts: list[str] = []
    for cls in classes:
        _describe(cls, texts)
    return hashlib.sha256("\n".join(texts).encode()).hexdigest()


def _describe(cls: type, texts: list[str]) -> None:
    for name, (slot, text) in slots_of(cls).items():
        texts.append(f"{name} {text}")
        element = getattr(slot, "value_type", slot)
        if hasattr(element, "namespaces"):  # a message
            texts.append("(")
            _describe(message_class(element), texts)
            texts.append(")")


def unknown_field(
    path: str, name: object, fields: Sequence[str], ros_type: str, given: str = ""
) -> FieldError:
    """Return the error for a field that does not exist, with the most similar existing one.

    `path` ends with the unknown `name`. `given` is the value for the field, as text.
    """
    meant = _ROS_1.get(str(name), "")
    near = [meant] if meant in fields else similar_names(str(name), fields)
    hint = f"; did you mean {near[0]!r}?" if near else "."
    valid = f"Its fields are: {', '.join(fields)}" if fields else "It has no fields"
    return FieldError(path, name, f"{shown(name)}{given} is no field of {ros_type}{hint} {valid}")


@lru_cache(maxsize=1024)
def _resolve(cls: type, path: str) -> tuple[tuple[tuple[str, int | None, str], ...], str]:
    """Return a path's steps (field name, index or None, the path up to there) and its ROS type."""
    from rosidl_parser.definition import AbstractNestedType, NamespacedType

    steps: list[tuple[str, int | None, str]] = []
    upto = ""
    text = type_name(cls)
    inside: type | None = cls
    for part in path.split("."):
        match = _PATH_PART.fullmatch(part)
        if match is None:
            example = "a path looks like pose.position.x or poses[0].header"
            raise FieldError(path, path, f"{part!r} is not a field name in {path!r}; {example}")
        name = match[1]
        if inside is None:
            raise FieldError(path, name, f"{upto} is of type {text} and has no field {name!r}")
        slots = slots_of(inside)
        upto = f"{upto}.{name}" if upto else name
        if name not in slots:
            raise unknown_field(upto, name, list(slots), type_name(inside))
        slot, text = slots[name]
        index = None if match[2] is None else int(match[2])
        if index is not None:
            if not isinstance(slot, AbstractNestedType):
                raise FieldError(
                    upto, index, f"it is of type {text}, no array; leave out the [{index}]"
                )
            most: int | None = getattr(slot, "size", getattr(slot, "maximum_size", None))
            if most is not None and index >= most:
                raise FieldError(upto, index, f"there is never an element {index} in a {text}")
            slot = slot.value_type
            text = _element_text(text)
        steps.append((name, index, upto))
        inside = message_class(slot) if isinstance(slot, NamespacedType) else None
        upto += "" if index is None else f"[{index}]"
    return tuple(steps), text


def _element_text(text: str) -> str:
    """Return the type of an array's elements: `int32` for `int32[3]` and `sequence<int32, 3>`."""
    if text.startswith("sequence<"):
        return text[len("sequence<") : -1].partition(", ")[0]
    return text.rpartition("[")[0]

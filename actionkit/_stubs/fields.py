"""What a field of a message is to a type checker: as it is read, and as it may be given."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

Has = Callable[[str, str, str], bool]
"""Of package, kind and name: whether there are stubs for that type."""

INTEGERS = {f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)}
_NUMPY = {"float": "float32", "double": "float64", **{name: name for name in INTEGERS}}
"""What ROS keeps as `array.array` (sequences) and numpy arrays (of a fixed length)."""
_PLAIN = {"boolean": "bool", "octet": "bytes", "char": "str", "wchar": "str"}


class Names:
    """The names that one class of a stub file writes, and the imports that these need.

    Whatever a stub file imports has a name that begins with `_`, because a field cannot: fields
    called `array`, `typing` or `numpy` hide nothing. `taken` are the names of the class's members:
    what Python has under one of them is written as `_builtins.int`.
    """

    def __init__(self, imports: set[str], taken: set[str]) -> None:
        self._imports = imports
        self._taken = taken

    def builtin(self, name: str) -> str:
        """Return how to write a name such as `int` or `property`."""
        if name not in self._taken:
            return name
        self._imports.add("import builtins as _builtins")
        return f"_builtins.{name}"

    def imported(self, module: str, name: str) -> str:
        """Return how to write a name that comes from a module of the standard library or numpy."""
        self._imports.add(f"from {module} import {name} as _{name}")
        return f"_{name}"

    def ros(self, package: str, kind: str, name: str) -> str:
        """Return how to write the class of a ROS type, in whatever package it is."""
        alias = f"_{package}_{kind}"
        self._imports.add(f"import {package}.{kind} as {alias}")
        return f"{alias}.{class_path(kind, name)}"


@dataclass(frozen=True)
class FieldType:
    """The types of a field, as they are written.

    Attributes:
        read: What one gets.
        given: What one may assign, or give as a keyword.
    """

    read: str
    given: str


def class_path(kind: str, name: str) -> str:
    """Return where a class is to be found: `Fibonacci_Goal` is `Fibonacci.Goal`."""
    if kind == "msg":
        return name
    first, *rest = name.split("_")
    if kind == "action" and rest and rest[0] in ("SendGoal", "GetResult"):
        rest = ["Impl", f"{rest[0]}Service", *rest[1:]]
    elif rest == ["FeedbackMessage"]:
        rest = ["Impl", *rest]
    return ".".join([first, *rest])


def field_type(slot: Any, names: Names, has: Has) -> FieldType:
    """Return the types of a field."""
    from rosidl_parser.definition import AbstractGenericString, AbstractNestedType, Array

    if not isinstance(slot, AbstractNestedType):
        one = _item(slot, names, has)
        return FieldType(one, one)
    item = _item(slot.value_type, names, has)
    typename = getattr(slot.value_type, "typename", "")
    if typename in _NUMPY:
        if isinstance(slot, Array):
            vector = names.imported("numpy.typing", "NDArray")
            number = names.imported("numpy", _NUMPY[typename])
            anything = f"{vector}[{names.imported('typing', 'Any')}]"
            sequence = names.imported("collections.abc", "Sequence")
            return FieldType(f"{vector}[{number}]", f"{sequence}[{item}] | {anything}")
        return FieldType(
            f"{names.imported('array', 'array')}[{item}]",
            f"{names.imported('collections.abc', 'Iterable')}[{item}]",
        )
    read = f"{names.builtin('list')}[{item}]"
    if isinstance(slot.value_type, AbstractGenericString):
        # Not `Sequence`: a single str would be one, and nearly always a mistake.
        return FieldType(read, f"{read} | {names.builtin('tuple')}[{item}, ...]")
    return FieldType(read, f"{names.imported('collections.abc', 'Sequence')}[{item}]")


def _item(slot: Any, names: Names, has: Has) -> str:
    from rosidl_parser.definition import AbstractGenericString, NamespacedType

    if isinstance(slot, NamespacedType):
        package, kind = slot.namespaces
        if not has(package, kind, slot.name):
            return names.imported("typing", "Any")
        return names.ros(package, kind, slot.name)
    if isinstance(slot, AbstractGenericString):
        return names.builtin("str")
    if slot.typename in INTEGERS:
        return names.builtin("int")
    return names.builtin(_PLAIN.get(slot.typename, "float"))


def constant(value: bool | int | float | str | bytes, names: Names) -> str:
    """Return type and, where it can be written, value of a constant: `ClassVar[int] = 5`."""
    written = "" if isinstance(value, float) and not math.isfinite(value) else f" = {value!r}"
    kind = names.builtin(type(value).__name__)
    return f"{names.imported('typing', 'ClassVar')}[{kind}]{written}"

"""The types of a message's field for a type checker: to read it, and to assign it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from rosidl_parser import definition

_INTEGERS = {f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)}
_NUMPY = {"float": "float32", "double": "float64", **{name: name for name in _INTEGERS}}
"""Types that ROS keeps in an `array.array` (sequences) or a numpy array (fixed length)."""
_INSIDE = {
    "SendGoal": "Impl.SendGoalService",
    "GetResult": "Impl.GetResultService",
    "FeedbackMessage": "Impl.FeedbackMessage",
}
"""Part of a class's name -> where the class is in an action, if not under that name."""
_PLAIN = {"boolean": "bool", "octet": "bytes", "char": "str", "wchar": "str"}


@dataclass(frozen=True)
class Names:
    """The names that one class of a stub file writes, and the imports that these need.

    All imported names begin with `_`, because a field's name cannot: so fields called `array`,
    `typing` or `numpy` hide nothing. A builtin with the same name as a member is written as
    `_builtins.int`.
    """

    imports: set[str]  # those of the file
    taken: set[str]  # the names of the class's members
    has: Callable[[str, str, str], bool]  # (package, kind, name) -> whether the type exists

    def builtin(self, name: str) -> str:
        """Return how to write a name such as `int` or `property`."""
        if name not in self.taken:
            return name
        self.imports.add("import builtins as _builtins")
        return f"_builtins.{name}"

    def imported(self, module: str, name: str) -> str:
        """Return how to write a name that comes from a module of the standard library or numpy."""
        self.imports.add(f"from {module} import {name} as _{name}")
        return f"_{name}"

    def ros(self, package: str, kind: str, name: str) -> str:
        """Return how to write the class of a ROS type, in any package."""
        if not self.has(package, kind, name):
            return self.imported("typing", "Any")
        alias = f"_{package}_{kind}"
        self.imports.add(f"import {package}.{kind} as {alias}")
        return f"{alias}.{class_path(name)}"


def class_path(name: str) -> str:
    """Return how Python reaches a class: `Fibonacci_Goal` is `Fibonacci.Goal`."""
    first, *rest = name.split("_")
    return ".".join([first, *(_INSIDE.get(part, part) for part in rest)])


def field_types(slot: Any, names: Names) -> tuple[str, str]:
    """Return the text of a field's types: the one to read, and the one to assign."""
    if not isinstance(slot, definition.AbstractNestedType):
        one = _item(slot, names)
        return one, one
    item = _item(slot.value_type, names)
    typename = getattr(slot.value_type, "typename", "")
    if typename in _NUMPY and isinstance(slot, definition.Array):
        vector = names.imported("numpy.typing", "NDArray")
        number = names.imported("numpy", _NUMPY[typename])
        anything = f"{vector}[{names.imported('typing', 'Any')}]"
        sequence = names.imported("collections.abc", "Sequence")
        return f"{vector}[{number}]", f"{sequence}[{item}] | {anything}"
    if typename in _NUMPY:
        iterable = names.imported("collections.abc", "Iterable")
        return f"{names.imported('array', 'array')}[{item}]", f"{iterable}[{item}]"
    read = f"{names.builtin('list')}[{item}]"
    if isinstance(slot.value_type, definition.AbstractGenericString):
        # Not `Sequence`: a single str is one too, and is nearly always a mistake.
        return read, f"{read} | {names.builtin('tuple')}[{item}, ...]"
    return read, f"{names.imported('collections.abc', 'Sequence')}[{item}]"


def _item(slot: Any, names: Names) -> str:
    if isinstance(slot, definition.NamespacedType):
        package, kind = slot.namespaces
        return names.ros(package, kind, slot.name)
    if isinstance(slot, definition.AbstractGenericString):
        return names.builtin("str")
    if slot.typename in _INTEGERS:
        return names.builtin("int")
    return names.builtin(_PLAIN.get(slot.typename, "float"))


def constant(value: bool | int | float | str | bytes, names: Names) -> str:
    """Return a constant's type and, if it can be written, its value: `ClassVar[int] = 5`."""
    written = "" if isinstance(value, float) and not math.isfinite(value) else f" = {value!r}"
    kind = names.builtin(type(value).__name__)
    return f"{names.imported('typing', 'ClassVar')}[{kind}]{written}"

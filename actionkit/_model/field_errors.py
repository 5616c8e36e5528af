"""The exceptions for values that do not fit a field; they name the field by its path."""

from __future__ import annotations

import pickle
import reprlib

from actionkit._model.printable import full_stop, visible

_short = reprlib.Repr()
_short.maxstring = _short.maxother = _short.maxlong = (
    60  # characters; the rest of the line has other text
)


def shown(value: object) -> str:
    """Return a short `repr` of a value for error texts; invisible characters are escaped."""
    try:
        return visible(_short.repr(value))
    except ValueError:  # Python refuses to write out integers of thousands of digits
        return f"<{type(value).__name__} too long to show>"


class FieldProblem(Exception):
    """A value does not fit a field of a ROS message.

    Attributes:
        path: The field, from the outermost message: `pose.position.x`, `poses[3].header`; empty
            for the message itself.
        value: The value that was refused.
        problem: What is wrong with it and what to give instead, the value's `repr` included.
    """

    def __init__(self, path: str, value: object, problem: str) -> None:
        super().__init__(path, value, problem)
        self.path = path
        self.value = value
        self.problem = problem

    def __str__(self) -> str:
        return full_stop(f"{self.path}: {self.problem}" if self.path else self.problem)

    def __reduce__(self) -> tuple[type[FieldProblem], tuple[str, object, str]]:
        # The refused value may be anything, such as a lambda. But it must be possible to send the
        # error to another process (C3.2).
        value = self.value
        try:
            pickle.dumps(value)
        except Exception:  # noqa: BLE001 - pickling runs code of the value's own class
            value = shown(value)
        return type(self), (self.path, value, self.problem)

    def add_parent(self, part: str) -> None:
        """Prepend the name or `[index]` of the field that contains the present path."""
        joint = "." if self.path and not self.path.startswith("[") else ""
        self.path = f"{part}{joint}{self.path}"


class FieldError(FieldProblem, ValueError):
    """The value's type is right, the value is not: out of range, too long, no such field."""


class FieldTypeError(FieldProblem, TypeError):
    """The field cannot hold a value of this type."""


def wrong_type(value: object, ros_type: str, needed: str) -> FieldTypeError:
    """Return the error for a value of the wrong type; `needed` has an article: `an int`."""
    if value is None:
        problem = (
            f"None is not allowed for {ros_type}; "
            f"give {needed}, or leave the field out to keep its default"
        )
    else:
        problem = f"{shown(value)} is of type {type(value).__name__}, but {ros_type} needs {needed}"
    return FieldTypeError("", value, problem)

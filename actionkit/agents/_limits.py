"""The limits that a configuration puts on one field."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


class Absent:
    """The type of a limit that was not set, where any value may be one."""

    def __repr__(self) -> str:
        return "<not set>"

    def __bool__(self) -> bool:
        return False


ABSENT = Absent()


@dataclass(frozen=True)
class Limits:
    """What the configuration says of one field of a goal.

    Attributes:
        minimum: The smallest number, of an array's elements, too.
        maximum: The largest.
        enum: The only values.
        max_length: The most bytes of UTF-8 of a string; 16-bit units of a wide one.
        max_items: The most elements of an array.
        const: The value that is always sent; the model neither sees nor sets the field.
        default: What is sent where the model leaves the field out.
        description: For the model.
        expose: Whether the model sees the field and what lies in it; as its parent, where unset.
        required: Whether the model must give it.
    """

    minimum: float | int | None = None
    maximum: float | int | None = None
    enum: tuple[Any, ...] | None = None
    max_length: int | None = None
    max_items: int | None = None
    const: Any = ABSENT
    default: Any = ABSENT
    description: str = ""
    expose: bool | None = None
    required: bool = False

    @property
    def is_limited(self) -> bool:
        """Whether it limits the values."""
        limits = (self.minimum, self.maximum, self.enum, self.max_length, self.max_items)
        return any(limit is not None for limit in limits)


NO_LIMITS = Limits()

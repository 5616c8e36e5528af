"""The limits that a configuration puts on one field."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    Strict,
    ValidationInfo,
    field_validator,
    model_validator,
)

ABSENT: Any = object()
"""Means that a limit was not set, for limits that can have any value, also `None`."""


class Table(BaseModel):
    """A table of a configuration."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True)

    @model_validator(mode="before")
    @classmethod
    def _as_dict(cls, value: Any) -> Any:
        return dict(value) if isinstance(value, Mapping) else value


class Limits(Table):
    """What the configuration says of one field of a goal.

    Attributes:
        minimum: The smallest number, of an array's elements, too.
        maximum: The largest.
        max_length: The most bytes of UTF-8 of a string; 16-bit units of a wide one.
        max_items: The most elements of an array.
        enum: The only values.
        const: The value that is always sent; the model neither sees nor sets the field.
        default: What is sent where the model leaves the field out.
        description: For the model.
        expose: Whether the model sees the field and what lies in it; as its parent, where unset.
        required: Whether the model must give it.
    """

    minimum: Any = None
    maximum: Any = None
    max_length: Annotated[int, Field(ge=0, le=sys.maxsize)] | None = None
    max_items: Annotated[int, Field(ge=0, le=1_000_000)] | None = None
    enum: Annotated[list[Any], Strict(False)] | None = None  # a tuple, too
    const: Any = Field(default_factory=lambda: ABSENT)
    default: Any = Field(default_factory=lambda: ABSENT)
    description: str | None = None
    expose: bool | None = None
    required: bool = False

    @field_validator("*")
    @classmethod
    def _fits(cls, value: Any, info: ValidationInfo) -> Any:
        """Ask the field's type, which is the context."""
        return value if info.context is None else info.context.limit(info.field_name, value, info)

    @property
    def is_limited(self) -> bool:
        """Whether it limits the values."""
        limits = (self.minimum, self.maximum, self.enum, self.max_length, self.max_items)
        return any(limit is not None for limit in limits)


NO_LIMITS = Limits()

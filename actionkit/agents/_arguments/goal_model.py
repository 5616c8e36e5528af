"""What a model may send as a goal: checked by pydantic, described by a JSON Schema (2020-12).

One walk through the message class makes both, so that they cannot say different things. Importing
this is slow (pydantic, rosidl_parser); it is loaded with the first configuration.
"""
# C10.2

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from pydantic_core import SchemaValidator, ValidationError, core_schema
from rosidl_parser.definition import (
    AbstractGenericString,
    AbstractNestedType,
    NamespacedType,
)

from actionkit._messages.comments import comments, constants
from actionkit._messages.convert import to_plain
from actionkit._messages.paths import message_class, slots_of, type_name
from actionkit.agents._arguments.argument_size import check_size
from actionkit.agents._arguments.goal_values import (
    Part,
    float32,
    list_part,
    number_bounds,
    number_part,
    one_of,
    string_part,
    unit_of,
)
from actionkit.agents._arguments.limits import ABSENT, NO_LIMITS, Limits
from actionkit.agents._arguments.problems import sentences
from actionkit.agents._values import DIALECT

_MOST_PROBLEMS = 10
DUMMY = "structure_needs_at_least_one_member"
"""rosidl's, in messages without fields."""


class GoalModel:
    """Checks the arguments of a tool.

    Attributes:
        schema: Of the arguments, as the model sees it.
        exposed: The paths of the fields that the model can set.
        hidden: Those of all others, except constants.
        unlisted: Those hidden because the configuration does not mention them.
        unlimited: Of those exposed, the numbers without limits.
        problems: Of limits that contradict each other or the type: path, key or `""`, text.
    """

    def __init__(self, cls: type, limits: Mapping[str, Limits], *, expose_all: bool) -> None:
        builder = _Builder(limits)
        part = builder.message(cls, "", to_plain(cls()), expose_all or None)
        about = _about(cls, "")
        self.schema = {"$schema": DIALECT, **part.schema}
        if about:
            self.schema["description"] = about
        self.exposed = tuple(builder.exposed)
        self.hidden = tuple(builder.hidden)
        off = [f"{path}." for path, own in limits.items() if own.expose is False]
        self.unlisted = tuple(p for p in self.hidden if not f"{p}.".startswith(tuple(off)))
        self.unlimited = tuple(builder.unlimited)
        self.problems = tuple(builder.problems)
        self._validator = SchemaValidator(part.check)

    def check(self, arguments: object) -> tuple[dict[str, Any], list[str]]:
        """Return the fields to send, and what is wrong: then the fields are empty.

        The fields are those given, and the defaults and constants of the limits.
        """
        fields, problems = _checked(self._validator, self.schema, arguments)
        return fields or {}, problems


def check_value(slot: Any, value: object, limits: Limits = NO_LIMITS) -> tuple[Any, list[str]]:
    """Return a value of the configuration as it is to be sent, and what is wrong with it.

    Args:
        slot: The field's type, as rosidl describes it.
        value: For the whole field; the model need not be able to set it.
        limits: Of the field.
    """
    part = _Builder({"": limits}).field(slot, "", None, True, "")
    if part.check is None:
        return None, [f"a {getattr(slot, 'typename', 'field of this type')} cannot be set"]
    return _checked(SchemaValidator(part.check), part.schema, value)


def _checked(
    validator: SchemaValidator, schema: Mapping[str, Any], value: object
) -> tuple[Any, list[str]]:
    if (too_large := check_size(value)) is not None:
        return None, [too_large]
    try:
        return validator.validate_python(value), []
    except ValidationError as error:
        return None, sentences(error, schema, most=_MOST_PROBLEMS)


class _Builder:
    def __init__(self, limits: Mapping[str, Limits]) -> None:
        self.exposed: list[str] = []
        self.hidden: list[str] = []
        self.unlimited: list[str] = []
        self.problems: list[tuple[str, str, str]] = []
        self._limits = limits

    def message(self, cls: type, path: str, value: Any, exposed: bool | None) -> Part:
        """Build a message.

        Args:
            cls: Its class.
            path: From the goal, `""` for the goal itself.
            value: What ROS sends if nothing in it is set, as plain values.
            exposed: Whether the model sees all or none of its fields, `None` for those that the
                configuration lists. Each field may say otherwise.
        """
        texts = comments(type_name(cls))
        fields: dict[str, core_schema.TypedDictField] = {}
        properties: dict[str, Any] = {}
        required: list[str] = []
        sent: dict[str, Any] = {}
        filled: dict[str, Any] = {}
        for name, (slot, _) in slots_of(cls).items():
            if name == DUMMY:
                continue
            below = f"{path}.{name}" if path else name
            const = self._limits.get(below, NO_LIMITS).const
            if const is not ABSENT:
                sent[name] = const
                continue
            plain = value[name] if isinstance(value, Mapping) else None
            part = self.field(slot, below, plain, exposed, texts.get(name, ""))
            if part.sent is not ABSENT:
                sent[name] = part.sent
            if part.check is None:
                continue
            if part.filled is not ABSENT:
                filled[name] = part.filled
            if part.needed:
                required.append(name)
            must = part.needed and part.filled is ABSENT
            fields[name] = core_schema.typed_dict_field(part.check, required=must)
            properties[name] = part.schema
        schema: dict[str, Any] = {
            "type": "object",
            "properties": properties,
            "additionalProperties": False,
        }
        if required:
            schema["required"] = required
        check: Any = core_schema.typed_dict_schema(fields, extra_behavior="forbid")
        if filled:
            check = core_schema.no_info_before_validator_function(_below(filled), check)
        if sent:
            check = core_schema.no_info_after_validator_function(_below(sent), check)
        if path and not properties:
            return Part(None, {}, sent=sent or ABSENT)
        inside = bool(filled or sent or required)
        return Part(check, schema, filled={} if inside else ABSENT, needed=bool(required))

    def field(self, slot: Any, path: str, value: Any, exposed: bool | None, comment: str) -> Part:
        """Build one field; `value` and `exposed` as in `message`."""
        own = self._limits.get(path, NO_LIMITS)
        if own.expose is not None:
            exposed = own.expose
        if isinstance(slot, NamespacedType):
            cls = message_class(slot)
            part = self.message(cls, path, value, exposed)
            comment = _about(cls, comment)
        elif isinstance(slot, AbstractNestedType) and isinstance(slot.value_type, NamespacedType):
            part = self._messages(slot, path, value, exposed, own)
        else:
            visible = path in self._limits if exposed is None else exposed
            part = self._values(slot, path, value, own, visible=visible)
        if own.required:
            part.needed, part.filled = True, ABSENT
            if part.check is None:
                text = "is not exposed, so a model cannot give it; remove one of the two"
                self.problems.append((path, "required", text))
        if part.check is None:
            return part
        described = (own.description or comment, unit_of(slot, part.schema))
        if about := " ".join(filter(None, described)):
            part.schema["description"] = about
        default = value if own.default is ABSENT else part.sent
        if not isinstance(slot, NamespacedType) and not part.needed and _is_json(default):
            part.schema["default"] = default
        return part

    def _messages(
        self, slot: Any, path: str, value: Any, exposed: bool | None, own: Limits
    ) -> Part:
        """Build an array of messages; the model sees it if it sees anything of an element."""
        cls = message_class(slot.value_type)
        element = value[0] if value else to_plain(cls())
        item = self.message(cls, path, element, exposed)
        size: int = getattr(slot, "size", 0)
        if item.check is None:
            part = Part(None, {})
            if size and item.sent is not ABSENT:
                part.sent = [item.sent] * size
        else:
            part = list_part(slot, item.check, item.schema, own)
            part.needed = bool(size) and item.needed
            if size and item.filled is not ABSENT and not item.needed:
                part.filled = [{}] * size
        if own.default is not ABSENT:
            part.sent = self._default(slot, part, path, own)
            part.filled, part.needed = ABSENT, False
        return part

    def _values(self, slot: Any, path: str, value: Any, own: Limits, *, visible: bool) -> Part:
        """Build a single value, or an array of single values."""
        inner = slot.value_type if isinstance(slot, AbstractNestedType) else slot
        part = self._single(inner, path, own)
        if part.check is None:
            return part
        if inner is not slot:
            part = list_part(slot, part.check, part.schema, own)
        if own.default is not ABSENT:
            part.sent = self._default(slot, part, path, own)
        elif value is not None and (visible or own.is_limited):
            part.needed = not _accepts(part.check, value)
            if part.needed and not visible:
                text = "is not exposed, but its default is outside of its limits; set a default"
                self.problems.append((path, "", text))
        if not visible:
            self.hidden.append(path)
            return Part(None, {}, sent=part.sent)
        self.exposed.append(path)
        if number_bounds(inner) and own.enum is None and None in (own.minimum, own.maximum):
            self.unlimited.append(path)
        return part

    def _default(self, slot: Any, part: Part, path: str, own: Limits) -> Any:
        """Return the default of the configuration as it is to be sent."""
        if part.check is None:  # what is hidden has its limits and constants, too
            limits = {
                below: limit.model_copy(update={"expose": True})
                for below, limit in self._limits.items()
            }
            limits[path] = limits[path].model_copy(update={"default": ABSENT})
            part = _Builder(limits).field(slot, path, None, True, "")
        if part.check is None:
            value, problems = None, ["every field in it has a const"]
        else:
            value, problems = _checked(SchemaValidator(part.check), part.schema, own.default)
        self.problems += [(path, "default", problem) for problem in problems]
        return value

    def _single(self, slot: Any, path: str, own: Limits) -> Part:
        """Build a value that is neither an array nor a message."""
        if isinstance(slot, AbstractGenericString):
            part = string_part(slot, own)
        elif (bounds := number_bounds(slot)) is not None:
            low = bounds[0] if own.minimum is None else max(bounds[0], own.minimum)
            high = bounds[1] if own.maximum is None else min(bounds[1], own.maximum)
            part = number_part(slot, low, high, own.enum)
            for value in (low,) if own.enum is None else own.enum:
                if slot.typename == "float" and not low <= float32(low, high)(value) <= high:
                    within = f"no {slot.typename} lies within {low!r} to {high!r}"
                    self.problems.append((path, "", within))
        elif slot.typename == "boolean":
            part = Part(one_of(own.enum, core_schema.bool_schema(strict=True)), {})
            part.schema["type"] = "boolean"
        else:  # an IDL type that .msg files do not have
            return Part(None, {})
        if own.enum is not None:
            part.schema["enum"] = list(own.enum)
        return part


def _below(values: Mapping[str, Any]) -> Callable[[Any], Any]:
    """Return a function that adds what a mapping does not have."""
    return lambda given: {**values, **given} if isinstance(given, Mapping) else given


def _accepts(check: Any, value: object) -> bool:
    try:
        SchemaValidator(check).validate_python(value)
    except ValidationError:
        return False
    return True


def _about(cls: type, comment: str) -> str:
    named = constants(cls)
    about = comment or comments(type_name(cls)).get("", "")
    return " ".join(filter(None, (about, f"Constants: {named}" if named else "")))


def _is_json(value: Any) -> bool:
    """Tell whether it is there and has no number that JSON cannot write."""
    if isinstance(value, float):
        return math.isfinite(value)
    if isinstance(value, (list, tuple)):
        return all(map(_is_json, value))
    return value is not None

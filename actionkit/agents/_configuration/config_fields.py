"""The limits of a goal's fields, checked against its type and against each other."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from pydantic import ValidationError, ValidationInfo
from rosidl_parser.definition import AbstractGenericString, AbstractNestedType, NamespacedType

from actionkit._messages.paths import message_class, slots_of
from actionkit._model.field_errors import shown
from actionkit._model.similar_names import similar_names
from actionkit.agents._arguments.goal_model import DUMMY, GoalModel, check_value
from actionkit.agents._arguments.goal_values import number_bounds
from actionkit.agents._arguments.limits import ABSENT, NO_LIMITS, Limits
from actionkit.agents._arguments.problems import TABLE, Place, problems, quoted, refuse


@dataclass(frozen=True)
class _Type:
    """The type of a field.

    Attributes:
        slot: The type as rosidl describes it.
        text: The type as ROS writes it.
    """

    slot: Any
    text: str

    @property
    def inner(self) -> Any:
        """The type of the elements if it is an array, else the type itself."""
        return self.slot.value_type if isinstance(self.slot, AbstractNestedType) else self.slot

    def limit(self, key: str, value: Any, info: ValidationInfo) -> Any:
        """Check a limit against the type and the limits before it; return the value to use.

        Raises:
            ValueError: The limit does not fit.
        """
        slot, inner = self.slot, self.inner
        bounds = number_bounds(inner)
        is_text = isinstance(inner, AbstractGenericString)
        if key == "const":
            return _checked(slot, value)
        if key == "default":  # the goal's model checks its value
            self._is_for("single fields and arrays", not isinstance(slot, NamespacedType))
        elif value is None:
            return None
        elif key in ("minimum", "maximum"):
            self._is_for("numbers", bounds is not None)
            _checked(inner, value)
            # Keep the number as it was written: the check rounds it to 32 bits.
            value = int(value) if isinstance(bounds[0], int) else float(value)  # type: ignore[index]
            low = info.data["minimum"] if key == "maximum" and "minimum" in info.data else None
            if low is not None and value < low:
                raise ValueError(f"{value} is below the minimum {low}")
        elif key == "max_length":
            self._is_for("strings", is_text)
            _check_most(value, inner)
        elif key == "max_items":
            self._is_for("arrays", inner is not slot)
            _check_most(value, slot)
        elif key == "enum":
            is_flag = getattr(inner, "typename", "") == "boolean"
            self._is_for("numbers, strings and booleans", bounds or is_text or is_flag)
            if not value or len(value) != len({repr(one) for one in value}):
                raise ValueError("names a value twice" if value else "must not be empty")
            # Each value must also be within the other limits.
            known = ("minimum", "maximum", "max_length")
            limits = NO_LIMITS.model_copy(update={one: info.data.get(one) for one in known})
            refuse(((), text) for one in value for text in check_value(inner, one, limits)[1])
        return value

    def _is_for(self, those: str, possible: object) -> None:
        if not possible:
            raise ValueError(f"is for {those}, but this field is a {self.text}")


def read_fields(cls: type, content: object, *, expose_all: bool) -> GoalModel:
    """Return the model of a goal with its limits.

    Args:
        cls: The goal's message class.
        content: A table of limits for each path.
        expose_all: Whether a model sees the fields that are not listed, too.

    Raises:
        ValidationError: Something is wrong.
    """
    if not isinstance(content, Mapping):
        raise ValueError(f"{shown(content)} must be a table, as in [{TABLE}.fields.NAME]")
    types = dict(_types(cls, ""))
    limits: dict[str, Limits] = {}
    found: list[tuple[Place, str]] = []
    for written, table in content.items():
        if not isinstance(written, str):
            found.append(((), f"the name {shown(written)} must be a string"))
            continue
        path = written.replace("[]", "")
        if path not in types:
            near = similar_names(path, types)
            hint = f"did you mean {near[0]!r}?" if near else f"there are {', '.join(types)}"
            found.append(((written,), f"the goal has no such field; {hint}"))
        elif path in limits:
            found.append(((written,), "this field is listed twice: with and without []"))
        elif (whole := _unquoted(path, table)) != path:
            found.append(((written,), f"a path needs quotes: [{TABLE}.fields.{quoted(whole)}]"))
        else:
            limits[path] = NO_LIMITS
            found += [((written, key), text) for key, text in _contradictions(table)]
            try:
                limits[path] = Limits.model_validate(table, context=types[path])
            except ValidationError as error:
                wrong = problems(error, Limits.model_json_schema(), "key")
                found += [((written, *place), text) for place, text in wrong]
    refuse(found)
    model = GoalModel(cls, limits, expose_all=expose_all)
    found = [((path, key) if key else (path,), text) for path, key, text in model.problems]
    refuse([*_without_effect(types, limits, model), *found])
    fields = [path for path, of in types.items() if not isinstance(of.inner, NamespacedType)]
    if fields and not limits and not model.exposed:
        raise ValueError(
            "no field of the goal is listed, so a model could set none. List those that it may set,"
            f' such as [{TABLE}.fields.{quoted(fields[0])}], or set expose = "all" for all of them'
        )
    return model


def _types(cls: type, path: str) -> Iterator[tuple[str, _Type]]:
    """Yield the paths and types of all fields, with those in the elements of arrays."""
    for name, (slot, text) in slots_of(cls).items():
        if name == DUMMY:
            continue
        below = f"{path}.{name}" if path else name
        of = _Type(slot, text)
        yield below, of
        if isinstance(of.inner, NamespacedType):
            yield from _types(message_class(of.inner), below)


def _unquoted(path: str, content: object) -> str:
    """Return the path that was meant: without quotes, TOML makes nested tables of its parts."""
    if isinstance(content, Mapping):
        for key, below in content.items():
            if key not in Limits.model_fields and isinstance(below, Mapping):
                return _unquoted(f"{path}.{key}", below)
    return path


def _contradictions(table: object) -> Iterator[tuple[str, str]]:
    if isinstance(table, Mapping) and "const" in table:
        for key in table:
            if key in Limits.model_fields and key not in ("const", "description"):
                yield key, "has no meaning beside const; remove one of them"
    elif isinstance(table, Mapping) and table.get("required") is True and "default" in table:
        yield "required", "a field that must be given has no default; remove one of them"


def _checked(slot: Any, value: object) -> Any:
    """Return a value of the configuration as it is to be sent."""
    result, texts = check_value(slot, value)
    refuse(((), text) for text in texts)
    return result


def _check_most(value: int, slot: Any) -> None:
    if hasattr(slot, "size"):
        raise ValueError(f"this array always has {slot.size} elements; remove the limit")
    most = getattr(slot, "maximum_size", None)
    if most is not None and value > most:
        raise ValueError(f"{value} is more than the type allows, {most}")


def _without_effect(
    types: Mapping[str, _Type], limits: Mapping[str, Limits], model: GoalModel
) -> Iterator[tuple[Place, str]]:
    """Yield what has no effect: limits inside a constant, messages without any listed field."""
    inside = [*limits, *model.exposed]
    for path, own in limits.items():
        for above, limit in limits.items():
            if path.startswith(f"{above}.") and limit.const is not ABSENT:
                yield (path,), f"has no effect, because {above!r} has a const"
        says_more = own.expose is not None or own.const is not ABSENT or own.default is not ABSENT
        if isinstance(types[path].inner, NamespacedType) and not says_more:
            below = [one for one in types if one.startswith(f"{path}.")]
            if not any(one.startswith(f"{path}.") for one in inside):
                yield (
                    (path,),
                    "a model cannot set anything in it: list the fields in it, such as"
                    f" {next(iter(below), path)!r}, or set expose = true for all of them",
                )

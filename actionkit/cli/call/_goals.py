"""Turns the text of a goal, YAML or JSON, into a message, and checks each field."""

from __future__ import annotations

import json
import re
import time
from collections.abc import Mapping
from typing import Any

import click
import yaml

from actionkit._messages.convert import from_plain
from actionkit._messages.paths import message_class, slots_of, type_name
from actionkit._messages.types import NUMERIC_CODES
from actionkit._model.field_errors import FieldProblem, shown

_NOW = ("now", "auto")
"""The words for the present time, as `ros2` has them: "now" for stamps, "auto" for headers."""
MOST_TEXT = 2**24
"""Characters of a goal; an array of a million numbers has fewer."""
MOST_YAML = 2**20
"""Fewer characters, because reading YAML takes a thousand times as long as JSON."""
_MOST_WORDS = 2000
"""Characters of an error, which may quote the input: enough to see what is wrong."""
_NUMBER = re.compile(r"[-+]?((\.\d+|\d+(\.\d*)?)e[-+]?\d+|inf|nan)", re.I | re.A)
"""Numbers in YAML 1.2 and for Python's `float` (as in `ros2`), but text in YAML 1.1."""
_COLON = re.compile(r":\S")
"""A colon that YAML takes for a part of the text."""
_TIME = "builtin_interfaces/msg/Time"
_HEADER = "std_msgs/msg/Header"


def parse(text: str, goal_class: type) -> Any:
    """Return the goal from a text of YAML or JSON: a mapping of the goal's fields.

    Missing fields keep their defaults. `now` means the present time, in a stamp and in a header.

    Raises:
        click.BadParameter: It does not fit; the text names the field.
    """
    if len(text) > MOST_TEXT:
        raise _bad(f"it is longer than {MOST_TEXT} characters.")
    try:
        return _message(_read(text), goal_class)
    except RecursionError:
        raise _bad("it is nested too deeply.") from None


def _message(value: Any, goal_class: type) -> Any:
    if isinstance(value, str):  # quoted twice, as in some launch files and scripts
        value = _read(value)
    if value is None:
        # A program that fails in a pipe writes nothing. This must not start a robot.
        raise _bad("it is empty. Give {} for a goal with all defaults.")
    if not isinstance(value, Mapping):
        fields = ", ".join(slots_of(goal_class)) or "none"
        raise _bad(
            f"{shown(value)} is not a mapping of fields to values, as '{{order: 5}}' is."
            f"{_space(value)} The fields of {type_name(goal_class)} are: {fields}."
        )
    try:
        return from_plain(goal_class, fill_now(goal_class, value, time.time_ns()))
    except FieldProblem as error:
        unset = [key for key, given in value.items() if given is None]
        raise _bad(f"{error}{''.join(map(_space, unset[:1]))}") from error


def fill_now(cls: type, value: Any, nanoseconds: int) -> Any:
    """Return the value with the time in each stamp or header that says `now`.

    Numbers that YAML 1.1 reads as text become numbers, if the field is a number. Values that do not
    fit the class do not change.
    """
    name = type_name(cls)
    if isinstance(value, str) and value in _NOW and name in (_TIME, _HEADER):
        stamp = {"sec": nanoseconds // 10**9, "nanosec": nanoseconds % 10**9}
        return stamp if name == _TIME else {"stamp": stamp}
    if not isinstance(value, Mapping):
        return value
    filled = dict(value)
    for field, (slot, _) in slots_of(cls).items():
        if field in filled:
            filled[field] = _fill_field(slot, filled[field], nanoseconds)
    return filled


def _fill_field(slot: Any, value: Any, nanoseconds: int) -> Any:
    from rosidl_parser.definition import AbstractNestedType, NamespacedType

    if isinstance(slot, AbstractNestedType):
        if not (isinstance(value, list) and {str, dict} & set(map(type, value))):
            return value  # most often a long array of numbers
        return [_fill_field(slot.value_type, item, nanoseconds) for item in value]
    if isinstance(slot, NamespacedType):
        return fill_now(message_class(slot), value, nanoseconds)
    is_text = isinstance(value, str) and getattr(slot, "typename", "") in NUMERIC_CODES
    return float(value) if is_text and _NUMBER.fullmatch(value) else value


def _read(text: str) -> Any:
    try:
        return json.loads(text)  # JSON first: YAML takes a thousand times as long
    except ValueError:
        pass
    if len(text) > MOST_YAML:
        raise _bad(f"it is no JSON, and longer than {MOST_YAML} characters, the most for YAML.")
    try:
        return yaml.safe_load(text)
    except RecursionError:
        raise
    except Exception as error:  # such as an IndexError for `!!int ''`
        raise _bad(
            f"it is neither YAML nor JSON: {_where(error)}. A goal is written as '{{order: 5}}', in"
            " quotes."
        ) from error


def _space(value: object) -> str:
    """Return the remedy for what YAML takes for one text, such as `order:5`."""
    unspaced = isinstance(value, str) and _COLON.search(value)
    return " Put a space after each colon." if unspaced else ""


def _where(error: Exception) -> str:
    """Return what is wrong with a text of YAML, and where, on one line."""
    if not isinstance(error, yaml.MarkedYAMLError) or error.problem_mark is None:
        return " ".join(str(error).split())
    mark = error.problem_mark
    problem = str(error.problem).replace("'<stream end>'", "the end of the text")
    return f"line {mark.line + 1}, column {mark.column + 1}: {problem}"


def _bad(problem: str) -> click.BadParameter:
    if len(problem) > _MOST_WORDS:
        problem = f"{problem[:_MOST_WORDS]}..."
    return click.BadParameter(f"{problem} Nothing was sent.", param_hint="GOAL")

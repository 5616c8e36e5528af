"""How much of a goal is done, read from its feedback."""

from __future__ import annotations

import math
import sys
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest
from rosidl_parser.definition import NamespacedType
from test_msgs.action import Fibonacci, NestedMessage

from actionkit._messages.progress import Field, Progress, chosen, found


def feedback(**fields: float) -> Any:
    message = NestedMessage.Feedback()
    for name, value in fields.items():
        setattr(message.nested_field, name, value)
    return message


def shares(field: Field, messages: list[Any]) -> list[float | None]:
    progress = Progress(field)
    return [progress.share(message) for message in messages]


REMAINING = "nested_field.float64_value"
PERCENT = "nested_field.float32_value"


def test_what_remained_at_first_is_the_whole() -> None:
    field = chosen(f"{REMAINING}:remaining", NestedMessage.Feedback)
    messages = [feedback(float64_value=value) for value in (0.0, 8.0, 6.0, 10.0, 5.0, 0.0)]
    # Nothing is known before the first distance; a way that gets longer is a new whole.
    assert shares(field, messages) == [None, 0.0, 0.25, 0.0, 0.5, 1.0]


@pytest.mark.parametrize(
    ("text", "values", "expected"),
    [
        (f"{PERCENT}:percent", (0, 0.5, 50, 100, 120, -3), [0.0, 0.005, 0.5, 1.0, 1.0, 0.0]),
        (PERCENT, (25,), [0.25]),
        (f"{PERCENT}:share", (0.25, 1.0), [0.25, 1.0]),
        # More than 1 can be no share: it was a percentage all along.
        (f"{PERCENT}:share", (0.5, 1.5, 1.0), [0.5, 0.015, 0.01]),
        (f"{PERCENT}:remaining", (0.8, 0.2), [0.0, 0.75]),
        (f"{PERCENT}:8", (2, 8, 9), [0.25, 1.0, 1.0]),
        (PERCENT, (math.nan, math.inf), [None, None]),
    ],
)
@pytest.mark.every
def test_the_other_kinds(text: str, values: tuple[float, ...], expected: list[float]) -> None:
    field = chosen(text, NestedMessage.Feedback)
    assert shares(field, [feedback(float32_value=v) for v in values]) == pytest.approx(expected)


def test_an_array_counts_by_its_length_and_a_duration_by_its_seconds() -> None:
    field = chosen("sequence:4", Fibonacci.Feedback)
    assert shares(field, [Fibonacci.Feedback(sequence=[1] * n) for n in (1, 4)]) == [0.25, 1.0]
    eta = chosen("nested_field_no_pkg.duration_value:remaining", NestedMessage.Feedback)
    messages = []
    for seconds in (4, 1):
        messages.append(NestedMessage.Feedback())
        messages[-1].nested_field_no_pkg.duration_value.sec = seconds
        messages[-1].nested_field_no_pkg.duration_value.nanosec = 1_000_000_000 // (4 * seconds)
    assert shares(eta, messages) == pytest.approx([0.0, 1 - 1.25 / 4.0625])


NO_WORD = "must be percent, share, remaining, or the number it counts to"


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("nothing", "no field"),
        (
            "nested_field",
            "nested_field is a test_msgs/BasicTypes, which is no number, duration or array$",
        ),
        ("nested_field.bool_value", "is a boolean, which is no number"),
        (f"{PERCENT}:quick", f"^'quick' {NO_WORD}$"),
        (f"{PERCENT}:0", f"^'0' {NO_WORD}$"),
        (f"{PERCENT}:-1", f"^'-1' {NO_WORD}$"),
        (f"{PERCENT}:nan", f"^'nan' {NO_WORD}$"),
        (f"{PERCENT}:inf", f"^'inf' {NO_WORD}$"),
    ],
)
@pytest.mark.every
def test_a_field_that_cannot_tell(text: str, told: str) -> None:
    with pytest.raises(ValueError, match=told):
        chosen(text, NestedMessage.Feedback)


def like(**fields: str) -> Any:
    """Make a class that describes itself as a message with these fields does."""
    slots = tuple(SimpleNamespace() for _ in fields)
    return type(
        "Feedback",
        (),
        {
            "SLOT_TYPES": slots,
            "get_fields_and_field_types": classmethod(lambda cls: fields),
            "__module__": "some_msgs.action._some",
        },
    )


@pytest.mark.parametrize(
    ("fields", "expected"),
    [
        ({"distance_remaining": "float"}, Field("distance_remaining", "remaining")),
        ({"estimated_time_remaining": "builtin_interfaces/Duration", "distance_remaining": "float"},
         Field("distance_remaining", "remaining")),
        ({"distance_remaining": "float", "percent_complete": "double"},
         Field("percent_complete", "percent")),
        ({"progress": "float"}, Field("progress", "share")),
        ({"completion_percentage": "uint8"}, Field("completion_percentage", "percent")),
        ({"items_left": "int32"}, Field("items_left", "remaining")),
        ({"percent_done": "float"}, Field("percent_done", "percent")),
        ({"left_wheel_speed": "float", "sequence": "sequence<int32>"}, None),
        ({"battery_percentage": "float"}, None),
        ({"progress_text": "string"}, None),
        ({"progress": "float", "pct": "uint8"}, Field("pct", "percent")),
        ({"distance_remaining": "float", "RATIO": "float"}, Field("RATIO", "share")),
        ({"time_left": "builtin_interfaces/msg/Duration"}, Field("time_left", "remaining")),
    ],
)  # fmt: skip
@pytest.mark.every
def test_fields_are_known_by_their_names(fields: dict[str, str], expected: Field | None) -> None:
    assert found(like(**fields)) == expected


def inside(name: str, inner: Any, monkeypatch: pytest.MonkeyPatch, **fields: str) -> Any:
    """Make a class like that of a message, with fields and, last, one that is a message."""
    module: Any = ModuleType("fake_msgs.msg")
    setattr(module, name.title(), inner)
    monkeypatch.setitem(sys.modules, f"{name}_msgs", ModuleType(f"{name}_msgs"))
    monkeypatch.setitem(sys.modules, f"{name}_msgs.msg", module)
    cls = like(**fields, **{name: f"{name}_msgs/{name.title()}"})
    cls.SLOT_TYPES = (*cls.SLOT_TYPES[:-1], NamespacedType([f"{name}_msgs", "msg"], name.title()))
    return cls


def test_the_outermost_field_is_taken_and_its_last_name_says_what_it_is(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    third = inside("leg", like(percent="float"), monkeypatch, speed="float")
    assert found(third) == Field("leg.percent", "percent")
    second = inside("way", third, monkeypatch)
    assert found(second) == Field("way.leg.percent", "percent")
    assert found(inside("trip", second, monkeypatch)) is None  # seldom about the whole goal
    whole = inside("trip", second, monkeypatch, time_left="float")
    assert found(whole) == Field("time_left", "remaining")
    assert chosen("trip.way.leg.percent", whole) == Field("trip.way.leg.percent", "percent")
    assert chosen("trip.way.speed", whole) == Field("trip.way.speed", "percent")
    leg = like(progress="float")
    assert chosen("progress", leg) == Field("progress", "share")
    trip = inside("trip", inside("leg", leg, monkeypatch), monkeypatch)
    assert chosen("trip.leg.progress", trip) == Field("trip.leg.progress", "share")


def test_a_field_may_count_to_any_number() -> None:
    cls = like(points="int32[3]", speed="float")
    assert chosen("points:3", cls) == Field("points", "count", 3.0)
    assert chosen("speed:0.5", cls) == Field("speed", "count", 0.5)


def test_actions_without_such_a_field_have_none() -> None:
    assert found(Fibonacci.Feedback) is None
    assert found(NestedMessage.Feedback) is None

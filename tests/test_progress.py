"""How much of a goal is done, read from its feedback."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest
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
        (f"{PERCENT}:share", (0.5, 2.0, 1.0), [0.5, 0.02, 0.01]),
        (f"{PERCENT}:8", (2, 8, 9), [0.25, 1.0, 1.0]),
        (PERCENT, (math.nan, math.inf), [None, None]),
    ],
)
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
    assert shares(eta, messages) == [0.0, 0.75]


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("nothing", "no field"),
        ("nested_field", "no number"),
        ("nested_field.bool_value", "no number"),
        (f"{PERCENT}:quick", "'quick' must be"),
        (f"{PERCENT}:0", "'0' must be"),
        (f"{PERCENT}:nan", "'nan' must be"),
    ],
)
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
    ],
)  # fmt: skip
def test_fields_are_known_by_their_names(fields: dict[str, str], expected: Field | None) -> None:
    assert found(like(**fields)) == expected


def test_actions_without_such_a_field_have_none() -> None:
    assert found(Fibonacci.Feedback) is None
    assert found(NestedMessage.Feedback) is None

"""Goals as text, from YAML and JSON to messages and back."""

from __future__ import annotations

import json
import math

import click
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from test_msgs.action import Fibonacci, NestedMessage
from test_msgs.msg import Builtins, MultiNested, UnboundedSequences

from actionkit._messages.convert import to_plain
from actionkit.cli.call._goals import MOST_TEXT, MOST_YAML, fill_now, parse
from actionkit.cli.call._plain import as_yaml

AT = 1_700_000_000_250_000_000


def test_now_is_filled_in_wherever_there_is_a_stamp() -> None:
    stamp = {"sec": 1_700_000_000, "nanosec": 250_000_000}
    assert fill_now(Builtins, {"time_value": "now"}, AT) == {"time_value": stamp}
    # A duration is no time of day.
    assert fill_now(Builtins, {"duration_value": "now"}, AT) == {"duration_value": "now"}
    goal = {"nested_different_pkg": "now", "nested_field_no_pkg": {"time_value": "now"}}
    assert fill_now(NestedMessage.Goal, goal, AT) == {
        "nested_different_pkg": stamp,
        "nested_field_no_pkg": {"time_value": stamp},
    }
    value = {"array_of_arrays": [{"string_values": ["now", "now", "now"]}]}
    assert fill_now(MultiNested, value, AT) == value


def test_a_header_that_is_now_has_that_stamp() -> None:
    from geometry_msgs.msg import PoseStamped

    for word in ("now", "auto"):
        pose = fill_now(PoseStamped, {"header": word}, AT)
        assert pose == {"header": {"stamp": {"sec": 1_700_000_000, "nanosec": 250_000_000}}}
    named = fill_now(PoseStamped, {"header": {"stamp": "now", "frame_id": "now"}}, AT)
    assert named["header"]["frame_id"] == "now"


@pytest.mark.parametrize(
    "text", ["order: 5", "{order: 5}", '{"order": 5}', "# a comment\norder: 5\n", "{order: 0x5}"]
)
def test_a_goal_is_yaml_or_json(text: str) -> None:
    assert parse(text, Fibonacci.Goal) == Fibonacci.Goal(order=5)


def test_missing_fields_keep_their_defaults() -> None:
    for nothing in ("{}", " {}\n", "# all defaults\n{}"):
        assert parse(nothing, NestedMessage.Goal) == NestedMessage.Goal()


@pytest.mark.parametrize("text", ["", " \n", "~", "null", "Null", "---", "# a comment", "!!null x"])
def test_nothing_is_no_goal(text: str) -> None:
    """What a program that failed writes into a pipe must not start a robot."""
    with pytest.raises(
        click.BadParameter, match=r"Give \{\} for a goal with all defaults\..*sent\."
    ):
        parse(text, NestedMessage.Goal)


def bomb(inside: str) -> str:
    """Return YAML with a value that is 10 to the power of 12 times as long as its text."""
    lines = [f"a0: &a0 [{inside}]"]
    lines += [f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 10)}]" for n in range(1, 13)]
    return "\n".join([*lines, "order: *a12"])


HOSTILE = {
    "deep JSON": "[" * 100_000 + "]" * 100_000,
    "deep mapping": '{"order":' * 100_000 + "1" + "}" * 100_000,
    "deep YAML": "- " * 20_000,
    "deep YAML, flow": "{order: " + "[" * 20_000 + "]" * 20_000 + "}",
    "just so deep": "[" * 900 + "]" * 900,
    "a field just so deep": '{"order": ' + "[" * 900 + "]" * 900 + "}",
    "a bomb": bomb("1"),
    "a bomb that is no mapping": "["
    + bomb("1").replace("\n", ", ").replace("a0:", "{a0:", 1)
    + "}]",
    "a number without end": f"order: {'9' * 5000}",
    "a name without end": f"{{{'x' * 100_000}: 1}}",
    "no date": "order: 2001-99-99",
    "no number at all": "order: !!int ''",
    "no time": "order: !!timestamp x",
    "no truth": "order: !!bool x",
    "Python": "order: !!python/object/apply:os.system [echo]",
    "itself": "&a [*a]",
    "itself, in a field": "order: &a [*a]",
    "too long": " " * (MOST_TEXT + 1),
    "too long for YAML": "# " + " " * MOST_YAML + "\norder: 5",
}


@pytest.mark.parametrize("text", HOSTILE.values(), ids=HOSTILE)
def test_a_hostile_goal_is_refused_in_a_few_words(text: str) -> None:
    with pytest.raises(click.BadParameter) as caught:
        parse(text, Fibonacci.Goal)
    assert "Nothing was sent." in caught.value.message
    assert len(caught.value.message) < 2100


def test_a_long_goal_is_no_hostile_one() -> None:
    order = '{"order": 5' + " " * (MOST_YAML + 1) + "}"
    assert parse(order, Fibonacci.Goal) == Fibonacci.Goal(order=5)


def test_json_numbers_are_numbers() -> None:
    goal = parse('{"nested_field": {"float64_value": 1e3}}', NestedMessage.Goal)
    assert goal.nested_field.float64_value == 1000.0


def test_numbers_are_those_of_yaml_12_and_of_ros2() -> None:
    """PyYAML reads YAML 1.1, which wants a point in a number and a sign in its exponent."""
    for text, number in {
        "5e-06": 5e-06,
        "1e3": 1000.0,
        "+1E3": 1000.0,
        "-1.5E5": -150_000.0,
        ".5e1": 5.0,
        "1.e1": 10.0,
        "inf": math.inf,
        "-inf": -math.inf,
        "-.inf": -math.inf,
        ".Inf": math.inf,
        "'1e3'": 1000.0,
    }.items():
        goal = parse(f"{{nested_field: {{float64_value: {text}}}}}", NestedMessage.Goal)
        assert goal.nested_field.float64_value == number
    for text in ("nan", "NaN", ".nan"):
        goal = parse(f"{{nested_field: {{float32_value: {text}}}}}", NestedMessage.Goal)
        assert math.isnan(goal.nested_field.float32_value)
    with pytest.raises(click.BadParameter, match=r"order: 1000\.0 is of type float, but int32"):
        parse("{order: 1e3}", Fibonacci.Goal)
    with pytest.raises(click.BadParameter, match="float64_value: 'fast' is of type str"):
        parse("{nested_field: {float64_value: fast}}", NestedMessage.Goal)


def test_numbers_in_arrays_are_read_so_and_text_stays_text() -> None:
    value = {"float64_values": ["1e3", 2, "nan"], "string_values": ["1e3", "nan"]}
    filled = fill_now(UnboundedSequences, value, AT)
    assert filled["float64_values"][:2] == [1000.0, 2]
    assert math.isnan(filled["float64_values"][2])
    assert filled["string_values"] == ["1e3", "nan"]
    field = "unbounded_sequence_of_unbounded_sequences"
    inner = fill_now(MultiNested, {field: [{"float32_values": ["1e3"]}]}, AT)
    assert inner == {field: [{"float32_values": [1000.0]}]}


@pytest.mark.parametrize(
    "text", ['"{order: 5}"', "'{order: 5}'", '"order: 5"', json.dumps(json.dumps({"order": 5}))]
)
def test_a_goal_that_is_quoted_twice_is_that_goal(text: str) -> None:
    """As it comes out of a launch file."""
    assert parse(text, Fibonacci.Goal) == Fibonacci.Goal(order=5)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ('""', "Give {} for a goal with all defaults"),
        ('"[1, 2]"', r"\[1, 2\] is not a mapping"),
        ("order", "'order' is not a mapping"),
        ('"{order: 5"', "neither YAML nor JSON"),
    ],
)
def test_quoted_twice_it_is_checked_as_well(text: str, told: str) -> None:
    with pytest.raises(click.BadParameter, match=told):
        parse(text, Fibonacci.Goal)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (
            "{order: 5",
            r"line 1, column 10: expected ',' or '}', but got the end of the text\. A goal",
        ),
        ("[1, 2}", r"is written as '{order: 5}', in quotes\. Nothing was sent\.$"),
        ("order:5", r"not a mapping of .* Put a space after each colon\. The fields"),
        ("{order:5}", r"did you mean 'order'\? .* Put a space after each colon\. Nothing"),
    ],
)
def test_what_is_no_yaml_is_told_on_one_line_with_the_remedy(text: str, told: str) -> None:
    with pytest.raises(click.BadParameter, match=told) as caught:
        parse(text, Fibonacci.Goal)
    assert "\n" not in caught.value.message


@settings(deadline=None)  # the first one imports
@given(text=st.text(max_size=40))
def test_any_text_is_a_goal_or_is_refused_in_words(text: str) -> None:
    told = ""
    try:
        parsed = parse(text, Fibonacci.Goal)
    except click.BadParameter as error:
        parsed, told = None, error.message
    assert isinstance(parsed, Fibonacci.Goal) != ("Nothing was sent." in told)


@settings(deadline=None)
@given(
    order=st.integers(-(2**31), 2**31 - 1),
    numbers=st.lists(st.floats(width=32, allow_nan=False), min_size=1, max_size=1),
)
@pytest.mark.long
def test_what_is_shown_can_be_given(order: int, numbers: list[float]) -> None:
    goal = Fibonacci.Goal(order=order)
    assert parse(as_yaml(goal), Fibonacci.Goal) == goal
    nested = NestedMessage.Goal()
    nested.nested_field.float32_value = numbers[0]
    assert parse(as_yaml(nested), NestedMessage.Goal) == nested
    assert parse(json.dumps(to_plain(nested)), NestedMessage.Goal) == nested


def test_arrays_of_numbers_are_one_line_each() -> None:
    assert as_yaml(Fibonacci.Result(sequence=list(range(100)))).count("\n") == 1
    assert as_yaml(Fibonacci.Result()) == "    sequence: []\n"

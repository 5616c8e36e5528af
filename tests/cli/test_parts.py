"""The pure parts of the command line: progress, goals, the board of `watch`, rendering."""

from __future__ import annotations

import json
import math
import signal
import uuid
from types import SimpleNamespace
from typing import Any, cast

import click
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from test_msgs.action import Fibonacci, NestedMessage
from test_msgs.msg import Builtins, MultiNested

from actionkit import GoalEvent, GoalState
from actionkit._messages.convert import to_plain
from actionkit.cli import _signals
from actionkit.cli._calling import Calling
from actionkit.cli._doctor_graph import judged
from actionkit.cli._exits import Exit
from actionkit.cli._findings import Finding
from actionkit.cli._goal_board import Board
from actionkit.cli._goals import MOST_TEXT, MOST_YAML, fill_now, parse
from actionkit.cli._plain import as_yaml
from actionkit.cli._progress import Field, Progress, chosen, found

# --- progress ----------------------------------------------------------------------------------


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
        ({"left_wheel_speed": "string", "sequence": "sequence<int32>"}, None),
        ({"progress_text": "string"}, None),
    ],
)  # fmt: skip
def test_fields_are_known_by_their_names(fields: dict[str, str], expected: Field | None) -> None:
    assert found(like(**fields)) == expected


def test_actions_without_such_a_field_have_none() -> None:
    assert found(Fibonacci.Feedback) is None
    assert found(NestedMessage.Feedback) is None


# --- goals -------------------------------------------------------------------------------------

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
    """Return YAML whose value is 10 to the power of 12 times as long as its text."""
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
def test_what_is_shown_can_be_given(order: int, numbers: list[float]) -> None:
    goal = Fibonacci.Goal(order=order)
    assert parse(as_yaml(goal), Fibonacci.Goal) == goal
    nested = NestedMessage.Goal()
    nested.nested_field.float32_value = numbers[0]
    assert parse(as_yaml(nested), NestedMessage.Goal) == nested
    assert parse(json.dumps(to_plain(nested)), NestedMessage.Goal) == nested


# --- rendering ---------------------------------------------------------------------------------


def test_arrays_of_numbers_are_one_line_each() -> None:
    assert as_yaml(Fibonacci.Result(sequence=list(range(100)))).count("\n") == 1
    assert as_yaml(Fibonacci.Result()) == "    sequence: []\n"


# --- the board of `watch` ----------------------------------------------------------------------


def goal(number: int, state: str) -> Any:
    return SimpleNamespace(goal_id=f"{number:032x}", state=state, accepted=float(number))


def test_only_changes_are_told_and_what_ended_stays_so() -> None:
    board = Board()
    board.take(("/server",), 0.0)
    changed, _ = board.take([goal(1, "EXECUTING"), goal(2, "ACCEPTED")], 10.0)
    assert [row.state for row in changed] == ["EXECUTING", "ACCEPTED"]
    changed, _ = board.take([goal(1, "EXECUTING"), goal(2, "EXECUTING")], 11.0)
    assert [(row.state, row.before) for row in changed] == [("EXECUTING", "ACCEPTED")]
    board.take([goal(1, "SUCCEEDED")], 12.0)
    assert board.take([goal(1, "EXECUTING")], 13.0) == ([], False)
    assert board.counts() == {"SUCCEEDED": 1, "EXECUTING": 1}


def test_goals_are_lost_with_the_last_server_and_may_be_found_again() -> None:
    board = Board()
    board.take(("/one", "/two"), 0.0)
    board.take([goal(1, "EXECUTING"), goal(2, "SUCCEEDED")], 1.0)
    assert board.take(("/two",), 2.0) == ([], True)
    lost, _ = board.take((), 3.0)
    assert [(row.state, row.before) for row in lost] == [("LOST", "EXECUTING")]
    board.take([goal(1, "SUCCEEDED")], 4.0)
    assert board.counts() == {"SUCCEEDED": 2}


def test_the_board_is_bounded_and_keeps_what_runs() -> None:
    board = Board()
    board.take([goal(0, "EXECUTING")], 0.0)
    for number in range(1, 3000):
        board.take([goal(number, "SUCCEEDED")], float(number))
    assert len(board.goals) == 1000
    assert board.goals[f"{0:032x}"].state == "EXECUTING"
    assert f"{2999:032x}" in board.goals


# --- the judgement of `doctor` -----------------------------------------------------------------


def trip(**parts: Any) -> Any:
    usual = {
        "matched": 0.01, "first": 0.002, "asked": 1, "later": (0.001,) * 5, "answers": 1,
    }  # fmt: skip
    return SimpleNamespace(**{**usual, **parts})


@pytest.mark.parametrize(
    ("parts", "servers", "levels", "told"),
    [
        ({}, 1, ["ok"], "endpoints matched in 10 ms, first answer after 2.0 ms, then 1.0 ms"),
        ({"matched": None}, 1, ["problem"], "not matched"),
        ({"first": None, "asked": 5}, 1, ["problem"], "none of 5 questions"),
        ({"asked": 3}, 1, ["ok", "note"], "2 questions were lost"),
        ({"later": (0.3,) * 5}, 1, ["ok", "note"], "more than 100 ms"),
        ({"answers": 1}, 2, ["ok", "note"], "1 of 2 servers answer"),
    ],
)
def test_a_round_trip_is_judged(
    parts: dict[str, Any], servers: int, levels: list[str], told: str
) -> None:
    findings: list[Finding] = list(judged("/fibonacci", servers, trip(**parts)))
    assert [finding.level for finding in findings] == levels
    assert told in findings[-1].text


# --- the order in which a call is told ---------------------------------------------------------


def test_an_end_is_told_after_the_feedback_that_came_before_it() -> None:
    """The server's answer may be known while feedback is still on its way to be shown."""
    told: list[GoalState] = []
    report = SimpleNamespace(event=lambda event: told.append(event.state))
    calling = Calling(cast(Any, None), cast(Any, report), echo=True, progress=None)
    states = (GoalState.SENT, GoalState.ACCEPTED, GoalState.SUCCEEDED)
    events = [GoalEvent(uuid.UUID(int=1), 1, s, float(n), 0.0) for n, s in enumerate(states)]
    calling._future = cast(Any, SimpleNamespace(timeline=events))
    calling._catch_up(0.5)
    assert told == [GoalState.SENT]
    calling._catch_up(9.0)
    calling._catch_up(9.0)
    assert told == [GoalState.SENT, GoalState.ACCEPTED]
    calling._catch_up(9.0, ended=True)
    assert told == list(states)
    # An attempt that failed is no end of the call.
    events.append(GoalEvent(uuid.UUID(int=1), 1, GoalState.RETRYING, 3.0, 0.0))
    again = Calling(cast(Any, None), cast(Any, report), echo=True, progress=None)
    again._future = calling._future
    again._catch_up(9.0)
    assert told[-1] is GoalState.RETRYING


# --- signals -----------------------------------------------------------------------------------


def test_two_signals_of_one_press_are_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """The terminal sends Ctrl-C to all its processes, and a wrapper passes its own on."""
    first: list[Exit] = []
    left: list[tuple[Exit, str]] = []
    monkeypatch.setattr(_signals, "leave_at_once", lambda *said: left.append(said))
    before = signal.getsignal(signal.SIGINT)
    with _signals.handled(first.append, lambda: "farewell"):
        signal.raise_signal(signal.SIGINT)
        signal.raise_signal(signal.SIGINT)
        assert (first, left) == ([Exit.INTERRUPTED], [])
        monkeypatch.setattr(_signals, "_ONE_PRESS", -1.0)
        signal.raise_signal(signal.SIGTERM)
        signal.raise_signal(signal.SIGINT)
        assert (first, left) == ([Exit.INTERRUPTED], [(Exit.TERMINATED, "farewell")])
    assert signal.getsignal(signal.SIGINT) is before

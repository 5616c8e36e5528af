"""Pictures of goals: what is drawn, from events alone (contract C6.3)."""

from __future__ import annotations

import contextlib
import dataclasses
import itertools
import json
import math
import os
import re
import subprocess
import sys
import uuid
import xml.etree.ElementTree as ET
from collections.abc import Iterable
from pathlib import Path

import pytest
from click.testing import CliRunner
from hypothesis import given, settings
from hypothesis import strategies as st

import actionkit as ak
from actionkit import CallInfo, GoalEvent, GoalState, LoggedLine, Outcome, Timeline
from actionkit._observers.json_schema import event_line, outcome_line, parse_line
from actionkit.cli._app import app
from actionkit.cli._picture_layout import Bar, Phase, Sign, lay_out
from actionkit.cli._picture_scale import axis_for
from actionkit.cli._picture_svg import draw
from actionkit.cli.timeline import report

S = GoalState
SVG = "{http://www.w3.org/2000/svg}"
ABORTED = ak.GoalAbortedError("It was aborted.")
Steps = Iterable[tuple[float, GoalState, int]]


def call(
    steps: Steps, *, number: int = 1, began: float = 0.0, end: float | None = None, **fields: object
) -> list[LoggedLine]:
    """The lines of a call: events at seconds after its beginning, and its end where it has one."""
    info = CallInfo(
        uuid.UUID(int=number), "/fibonacci", "test_msgs/action/Fibonacci", "", 100 + began, 5e8
    )
    info = dataclasses.replace(info, wall=5e8 + began, **fields)  # type: ignore[arg-type]
    lines = [
        event_line(
            GoalEvent(
                uuid.UUID(int=number * 10 + attempt),
                attempt,
                state,
                info.monotonic + at,
                info.wall + at,
            ),
            info,
        )
        for at, state, attempt in steps
    ]
    if end is not None:
        failed = list(steps)[-1][1] is not S.SUCCEEDED if steps else True
        outcome = Outcome(
            S.SENDING, None, ABORTED if failed else None, 1, Timeline(), info.call_id, None
        )
        lines.append(outcome_line(dataclasses.replace(outcome, elapsed=end), info, None))
    return [parse_line(line) for line in lines]


RAN = [(0.0, S.SENDING, 1), (1.0, S.SENT, 1), (2.0, S.ACCEPTED, 1), (3.0, S.EXECUTING, 1)]
FED = [(3.5, S.FEEDBACK, 1), (4.0, S.FEEDBACK, 1)]
GOOD = [*RAN, *FED, (5.0, S.SUCCEEDED, 1)]
RETRIED = [
    *RAN,
    (5.0, S.LOST, 1),
    (5.0, S.RETRYING, 1),
    (6.0, S.SENDING, 2),
    (6.5, S.SENT, 2),
    (7.0, S.ACCEPTED, 2),
    (9.0, S.SUCCEEDED, 2),
]


# --- what is drawn -----------------------------------------------------------------------------


def test_a_goal_is_bars_by_phase() -> None:
    picture = lay_out([call(GOOD, end=5.0)])
    (row,) = picture.rows
    (lane,) = row.lanes
    assert lane.bars == [
        Bar(Phase.SERVER, 0.0, 1.0),
        Bar(Phase.ACCEPT, 1.0, 2.0),
        Bar(Phase.ACCEPTED, 2.0, 3.0),
        Bar(Phase.EXECUTING, 3.0, 5.0),
    ]
    assert lane.marks == [(Sign.SUCCEEDED, 5.0)]
    assert lane.feedback == [3.5, 4.0]
    assert (row.start, row.end, row.outcome, picture.end) == (0.0, 5.0, "ok", 5.0)


def test_attempts_are_lanes_with_the_pause_between() -> None:
    (row,) = lay_out([call(RETRIED, end=9.0)]).rows
    first, second = row.lanes
    assert first.bars[-1] == Bar(Phase.PAUSE, 5.0, 6.0)
    assert first.marks == [(Sign.LOST, 5.0)]
    assert (second.attempt, second.bars[0]) == (2, Bar(Phase.SERVER, 6.0, 6.5))
    assert second.marks == [(Sign.SUCCEEDED, 9.0)]


def test_a_goal_given_up_is_being_cancelled_until_its_end() -> None:
    steps = [*RAN, (5.0, S.TIMED_OUT, 1), (5.5, S.CANCELING, 1), (6.0, S.CANCELED, 1)]
    (lane,) = lay_out([call(steps, end=6.0)]).rows[0].lanes
    assert lane.bars[-2:] == [Bar(Phase.CANCELING, 5.0, 5.5), Bar(Phase.CANCELING, 5.5, 6.0)]
    assert lane.marks == [(Sign.TIMED_OUT, 5.0), (Sign.CANCELED, 6.0)]


def test_a_goal_that_was_never_sent_is_not_being_cancelled() -> None:
    (lane,) = lay_out([call([(0, S.SENDING, 1), (1, S.TIMED_OUT, 1)], end=2.0)]).rows[0].lanes
    assert lane.bars == [Bar(Phase.SERVER, 0.0, 1.0)]


def test_a_call_without_an_end_goes_on_to_the_end_of_the_picture() -> None:
    picture = lay_out([call(RAN), call(GOOD, number=2, began=3.0, end=5.0)])
    lane = picture.rows[0].lanes[0]
    assert lane.bars[-1] == Bar(Phase.EXECUTING, 3.0, 8.0)
    assert lane.marks == [(Sign.UNENDED, 8.0)]
    assert picture.rows[0].end is None


def test_a_call_that_ended_without_a_goals_end() -> None:
    unserved = lay_out([call([(0.0, S.SENDING, 1)], end=2.0)]).rows[0].lanes[0]
    assert unserved.bars == [Bar(Phase.SERVER, 0.0, 2.0)]
    assert unserved.marks == [(Sign.FAILED, 2.0)]
    invalid = lay_out([call([], end=0.5)]).rows[0]
    assert invalid.lanes[0].marks == [(Sign.FAILED, 0.5)]


def test_rows_are_in_the_order_in_which_calls_began() -> None:
    late, early = call(GOOD, number=1, began=4.0, end=5.0), call(GOOD, number=2, end=5.0)
    picture = lay_out([late, early])
    assert [row.start for row in picture.rows] == [0.0, 4.0]
    assert picture.wall == 5e8


def test_an_empty_log() -> None:
    assert lay_out([]).rows == []
    ET.fromstring(draw([]))


# --- the axis ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("seconds", "unit", "labels"),
    [
        (0.005, "ms", ["0", "0.5", "1", "1.5", "2", "2.5", "3", "3.5", "4", "4.5", "5"]),
        (0.9, "ms", ["0", "100", "200", "300", "400", "500", "600", "700", "800", "900"]),
        (12.0, "s", ["0", "2", "4", "6", "8", "10", "12"]),
        (600.0, "min", ["0", "1", "2", "3", "4", "5", "6", "7", "8", "9", "10"]),
        (36_000.0, "h", ["0", "1", "2", "3", "4", "5", "6", "7", "8", "9", "10"]),
    ],
)
def test_axes(seconds: float, unit: str, labels: list[str]) -> None:
    found, ticks = axis_for(seconds)
    assert (found, [label for _, label in ticks]) == (unit, labels)


@given(st.floats(1e-6, 1e7))
def test_any_axis_has_a_few_ticks_at_even_distances(seconds: float) -> None:
    _, ticks = axis_for(seconds)
    assert 4 <= len(ticks) <= 11
    places = [place for place, _ in ticks]
    assert places[0] == 0
    assert places[-1] <= seconds * (1 + 1e-6)
    assert len({label for _, label in ticks}) == len(ticks)


# --- the SVG -----------------------------------------------------------------------------------


def groups(svg: str, name: str) -> list[ET.Element]:
    return [g for g in ET.fromstring(svg).iter(f"{SVG}g") if str(g.get("class")).startswith(name)]


def test_it_stands_by_itself() -> None:
    svg = draw([call(RETRIED, end=9.0)], name="goals.jsonl")
    root = ET.fromstring(svg)
    assert root.tag == f"{SVG}svg"
    assert not list(root.iter(f"{SVG}script"))
    assert "href" not in svg
    assert re.findall(r"https?://[^\"]+", svg) == ["http://www.w3.org/2000/svg"]


def test_the_legend_has_what_is_in_the_picture_and_nothing_else() -> None:
    (legend,) = groups(draw([call(GOOD, end=5.0)]), "legend")
    assert [text.text for text in legend.iter(f"{SVG}text")] == [
        "waiting for a server or its turn",
        "waiting for acceptance",
        "accepted",
        "executing",
        "feedback",
        "succeeded",
    ]


def test_the_axis_has_its_unit_and_its_date() -> None:
    svg = draw([call(GOOD, end=5.0)])
    texts = [text.text for text in ET.fromstring(svg).iter(f"{SVG}text")]
    assert "s since 1985-11-05 00:53:20.000 UTC" in texts
    assert texts.count("4") == 2  # above and below


def test_bars_are_where_their_times_are() -> None:
    svg = draw([call(GOOD, end=5.0)])
    bars = {r.get("class"): r for r in groups(svg, "attempt")[0].iter(f"{SVG}rect")}
    start = float(str(bars["server"].get("x")))
    widths = {name: float(str(bar.get("width"))) for name, bar in bars.items()}
    assert widths["executing"] == pytest.approx(2 * widths["server"], abs=0.02)
    assert float(str(bars["accepted"].get("x"))) == pytest.approx(
        start + 2 * widths["server"], abs=0.02
    )


def test_five_hundred_goals_fit() -> None:
    svg = draw([call(RETRIED, number=n, began=n * 0.1, end=9.0) for n in range(1, 501)])
    root = ET.fromstring(svg)
    height = float(str(root.get("height")))
    assert height < 3500
    assert len(groups(svg, "call ")) == 500
    assert len(groups(svg, "attempt")) == 1000
    labels = [t for t in root.iter(f"{SVG}text") if re.fullmatch(r"call \d+", str(t.text))]
    places = [float(str(text.get("y"))) for text in labels]
    assert 20 < len(places) < 200
    assert min(b - a for a, b in itertools.pairwise(places)) >= 12  # none on another
    for element in root.iter(f"{SVG}rect"):
        assert float(str(element.get("x", 0))) + float(str(element.get("width"))) <= 1200.5
        assert float(str(element.get("y", 0))) + float(str(element.get("height"))) <= height + 0.5


def test_ticks_are_as_many_as_can_be_seen() -> None:
    steps = [*RAN, *[(3 + n / 10_000, S.FEEDBACK, 1) for n in range(20_000)], (5, S.SUCCEEDED, 1)]
    (attempt,) = groups(draw([call(steps, end=5.0)]), "attempt")
    (ticks,) = [p for p in attempt.iter(f"{SVG}path") if p.get("class") == "feedback"]
    assert 50 < str(ticks.get("d")).count("M") < 400


def test_marks_do_not_cover_each_other() -> None:
    steps = [*RAN, (5.0, S.TIMED_OUT, 1), (5.001, S.CANCELED, 1)]
    (attempt,) = groups(draw([call(steps, end=5.001)]), "attempt")
    xs = [
        [float(point.split(",")[0]) for point in str(mark.get("points")).split()]
        for mark in attempt.iter(f"{SVG}polygon")
    ]
    assert len(xs) == 2
    assert max(xs[0]) <= min(xs[1])


def test_any_name_is_text() -> None:
    svg = draw([call(GOOD, end=5.0, action_name="/<b>&\x00\x1b\ud800")], name="<&>\x07")
    assert "/<b>&" in str(next(ET.fromstring(svg).iter(f"{SVG}text")).text)


STEPS = st.lists(
    st.tuples(st.floats(0, 1e4), st.sampled_from(GoalState), st.integers(1, 3)), max_size=15
).map(sorted)
CALLS = st.lists(st.tuples(STEPS, st.one_of(st.none(), st.floats(0, 2e4))), max_size=6)


@settings(deadline=None)
@given(CALLS)
def test_any_log_can_be_drawn(stories: list[tuple[Steps, float | None]]) -> None:
    calls = [
        lines
        for number, (steps, end) in enumerate(stories, 1)
        if (lines := call(steps, number=number, end=end))
    ]
    picture = lay_out(calls)
    for row in picture.rows:
        for lane in row.lanes:
            ends = [bar.end for bar in lane.bars]
            assert ends == sorted(ends)
            assert all(bar.start < bar.end for bar in lane.bars)
    root = ET.fromstring(draw(calls))
    assert len([g for g in root.iter(f"{SVG}g") if str(g.get("class")).startswith("call ")]) == len(
        calls
    )


NUMBERS = st.one_of(st.integers(-(10**18), 10**18), st.floats())


@settings(deadline=None)
@given(
    st.lists(
        st.dictionaries(st.sampled_from(["monotonic", "wall", "elapsed_ms", "attempt"]), NUMBERS),
        min_size=len(RETRIED) + 1,
        max_size=len(RETRIED) + 1,
    )
)
def test_any_times_that_are_read_can_be_drawn(changes: list[dict[str, float]]) -> None:
    lines = []
    for line, changed in zip(call(RETRIED, end=9.0), changes, strict=True):
        with contextlib.suppress(ValueError):
            lines.append(parse_line(json.dumps({**line.data, **changed})))
    calls = [lines] if lines else []
    report(calls)
    svg = draw(calls)
    ET.fromstring(svg)
    assert re.search(r"\b(nan|inf)\b", re.sub(r"<title>.*?</title>", "", svg, flags=re.S)) is None


def test_what_is_between_quotes_stays_there() -> None:
    lines = call(RAN, end=5.0)
    hostile = {**lines[-1].data, "outcome": 'x" onload="alert(1)'}
    (group,) = groups(draw([[*lines[:-1], parse_line(json.dumps(hostile))]]), "call ")
    assert group.get("onload") is None


# --- the command -------------------------------------------------------------------------------


def write(path: Path, *calls: list[LoggedLine]) -> Path:
    path.write_text("".join(json.dumps(line.data) + "\n" for lines in calls for line in lines))
    return path


def run(*words: object) -> tuple[int, str, str]:
    done = CliRunner().invoke(app, ["timeline", *map(str, words)], standalone_mode=False)
    if done.exception is not None:
        raise done.exception
    return int(done.return_value or 0), done.stdout, done.stderr


def test_the_command_prints_each_call(tmp_path: Path) -> None:
    log = write(tmp_path / "goals.jsonl", call(GOOD, end=5.0), call(RETRIED, number=2))
    code, out, err = run(log)
    assert (code, err) == (0, "")
    first, second = out.split("\n\n")
    assert first.splitlines()[0].startswith("/fibonacci (test_msgs/action/Fibonacci, process ")
    assert len(first.splitlines()) == len(GOOD) + 2
    assert first.splitlines()[-1] == "=> ok after 5000.0 ms"
    assert second.rstrip().splitlines()[-1] == "=> goal SUCCEEDED; no end of the call in this log"


def test_the_command_draws(tmp_path: Path) -> None:
    log = write(tmp_path / "goals.jsonl", call(GOOD, end=5.0), call(RETRIED, number=2, end=9.0))
    out = tmp_path / "goals.svg"
    assert run(log, "--svg", out)[0] == 0
    assert len(groups(out.read_text(), "call ")) == 2
    code, printed, _ = run(log, "--svg", "-", "--last", 1)
    assert code == 0
    assert len(groups(printed, "call ")) == 1


def test_times_that_are_none_are_left_out_and_told(tmp_path: Path) -> None:
    log = write(tmp_path / "goals.jsonl", call(GOOD, end=5.0))
    lines = log.read_text().splitlines()
    strange = [
        {**json.loads(lines[1]), "wall": wall} for wall in (math.nan, math.inf, "nan", 1e300)
    ]
    log.write_text("\n".join([*lines, *map(json.dumps, strange)]))
    out = tmp_path / "goals.svg"
    code, printed, err = run(log, "--svg", out)
    assert code == 0
    assert len(err.splitlines()) == 4
    assert all(line.startswith("not read: goals.jsonl:") for line in err.splitlines())
    assert "=> ok after 5000.0 ms" in printed
    assert "nan" not in out.read_text()


HOSTILE = "\x1b]0;owned\x07\x1b[2J\x9b31m\x7f\r\u202e\ud800"
"""Sets the title, clears the screen, turns the text round; and half a character."""
ESCAPED = r"\u001b]0;owned\u0007\u001b[2J\u009b31m\u007f\r\u202e\ud800"


def test_nothing_in_a_file_controls_the_terminal(tmp_path: Path) -> None:
    steps = [(0.0, S.SENDING, 1), (5.0, S.SUCCEEDED, 1)]
    lines = call(steps, end=5.0, action_name=HOSTILE, action_type=HOSTILE, node_name=HOSTILE)
    lines = [
        parse_line(json.dumps({**line.data, "detail": HOSTILE, "error": HOSTILE, "pid": 7}))
        for line in lines
    ]
    log = write(tmp_path / f"{HOSTILE[:-1]}.jsonl".replace("/", ""), lines)
    with log.open("a") as file:
        file.write(json.dumps({**lines[0].data, "state": HOSTILE}))
    done = subprocess.run(
        [sys.executable, "-m", "actionkit", "timeline", str(log)],
        capture_output=True,
        env=os.environ | {"PYTHONIOENCODING": "utf-8:strict"},
        timeout=60,
        check=False,
    )
    out, err = done.stdout.decode(), done.stderr.decode()
    assert done.returncode == 0, err
    for text in (out, err):
        assert set(text) - {"\n"} <= set(map(chr, range(32, 127))), text
    assert out.startswith(f"{ESCAPED} ({ESCAPED}, node {ESCAPED}, process 7)\n")
    assert f"{ESCAPED}, goal" in out
    assert out.endswith(f": {ESCAPED}\n")
    assert len(out.splitlines()) == 4
    ET.fromstring(draw([lines], name=log.name))


def test_the_command_tells_what_it_could_not_read(tmp_path: Path) -> None:
    log = write(tmp_path / "goals.jsonl", call(GOOD, end=5.0))
    log.write_text(log.read_text()[:-30])
    code, out, err = run(log)
    assert code == 0
    assert "SUCCEEDED" in out
    assert re.fullmatch(r"not read: goals.jsonl:8: \d+ bytes, cut off, or no JSON\n", err)


def test_a_file_of_something_else_is_one_error() -> None:
    from actionkit.cli._problems import Problem

    with pytest.raises(Problem) as caught:
        run(__file__)
    assert caught.value.code == 1
    assert f"{__file__} is no log of goals: of its" in caught.value.message
    assert "none could be read. The first is test_picture.py:1:" in caught.value.message


def test_many_bad_lines_are_not_all_told(tmp_path: Path) -> None:
    log = write(tmp_path / "goals.jsonl", call(GOOD, end=5.0))
    log.write_text(log.read_text() + "\n" + "{\n" * 230)
    code, out, err = run(log)
    assert code == 0
    assert "SUCCEEDED" in out
    assert len(err.splitlines()) == 11
    assert err.splitlines()[-1] == "not read: 220 lines more"


def test_a_log_without_goals_is_told(tmp_path: Path) -> None:
    log = tmp_path / "goals.jsonl"
    log.write_text("")
    assert run(log) == (1, "", f"{log}: there are no goals in it\n")


def test_a_file_that_is_not_there_is_a_wrong_argument(tmp_path: Path) -> None:
    import click

    with pytest.raises(click.UsageError, match="No such file"):
        run(tmp_path / "nothing.jsonl")
    log = write(tmp_path / "goals.jsonl", call(GOOD, end=5.0))
    with pytest.raises(click.ClickException, match="No such file"):
        run(log, "--svg", tmp_path / "nowhere" / "goals.svg")

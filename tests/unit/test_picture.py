"""Pictures of goals, drawn from events only (contract C6.3)."""

from __future__ import annotations

import contextlib
import dataclasses
import itertools
import json
import math
import os
import re
import sys
import uuid
import xml.etree.ElementTree as ET
from base64 import b64decode
from collections.abc import Iterable
from html import escape
from pathlib import Path

import pytest
from click.testing import CliRunner
from hypothesis import given, settings
from hypothesis import strategies as st

import actionkit as ak
from actionkit import CallInfo, GoalEvent, GoalState, LoggedLine, Outcome, Timeline
from actionkit._observers.json_schema import event_line, outcome_line, parse_line
from actionkit._recordings.pictures.layout import Activity, Sign, lay_out
from actionkit._recordings.pictures.names import shortened
from actionkit._recordings.pictures.svg import draw
from actionkit.cli._app import app
from actionkit.cli._shared.problems import Problem
from actionkit.cli.timeline import report
from tests import forked

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
GOOD = [*RAN, (3.5, S.FEEDBACK, 1), (4.0, S.FEEDBACK, 1), (5.0, S.SUCCEEDED, 1)]
RETRIED = [
    *RAN,
    (5.0, S.LOST, 1),
    (5.0, S.RETRYING, 1),
    (6.0, S.SENDING, 2),
    (6.5, S.SENT, 2),
    (7.0, S.ACCEPTED, 2),
    (9.0, S.SUCCEEDED, 2),
]


# --- what a reader sees ------------------------------------------------------------------------


def groups(svg: str, name: str) -> list[ET.Element]:
    return [g for g in ET.fromstring(svg).iter(f"{SVG}g") if str(g.get("class")).startswith(name)]


def shown(group: ET.Element) -> str:
    """Return the phases, marks and feedback of a goal, in the order in which they are drawn."""
    names = [str(part.get("class")).removeprefix("mark ") for part in group if part.get("class")]
    return " ".join(name for name, _ in itertools.groupby(names))


EXECUTING = "server accept accepted executing"
STORIES: dict[str, tuple[Steps, float | None, list[str]]] = {
    # What happened, when the call ended, and what is seen of each attempt.
    "succeeded": (GOOD, 5.0, [f"{EXECUTING} feedback succeeded"]),
    "aborted": ([*RAN, (5.0, S.ABORTED, 1)], 5.0, [f"{EXECUTING} aborted"]),
    "rejected": ([*RAN[:2], (5.0, S.REJECTED, 1)], 5.0, ["server accept rejected"]),
    "tried again": (RETRIED, 9.0, [f"{EXECUTING} pause lost", "server accept accepted succeeded"]),
    "given up": (
        [*RAN, (5.0, S.TIMED_OUT, 1), (5.5, S.CANCELING, 1), (6.0, S.CANCELED, 1)],
        6.0,
        [f"{EXECUTING} canceling timed_out canceled"],
    ),
    "never sent": ([(0, S.SENDING, 1), (1, S.TIMED_OUT, 1)], 2.0, ["server timed_out"]),
    "no end in the log": (RAN, None, [f"{EXECUTING} unended"]),
    "no end of the goal": ([(0.0, S.SENDING, 1)], 2.0, ["server failed"]),
    "invalid": ([], 0.5, ["failed"]),
}


@pytest.mark.parametrize("story", STORIES)
def test_a_goal_is_shown_by_its_phases_and_its_end(story: str) -> None:
    steps, end, expected = STORIES[story]
    svg = draw([call(steps, end=end), call([(0.0, S.REJECTED, 1)], number=2, began=20.0, end=0.0)])
    assert [shown(attempt) for attempt in groups(svg, "attempt")[:-1]] == expected
    # The legend has what is in the picture, and nothing else.
    names = {name for attempt in groups(svg, "attempt") for name in shown(attempt).split()}
    meanings = {each.name.lower(): each.value for each in (*Activity, *Sign)}
    (legend,) = groups(svg, "legend")
    told = [text.text for text in legend.iter(f"{SVG}text")]
    assert sorted(map(str, told)) == sorted(meanings.get(name, name) for name in names)


def test_each_goal_is_there_once_in_the_order_in_which_they_began() -> None:
    calls = [call(RETRIED, number=n, began=n * 0.1, end=9.0) for n in range(1, 301)]
    first = call([], number=400, end=0.5)
    svg = draw([*calls, first])
    assert [g.get("class") for g in groups(svg, "call ")] == [
        "call GoalAbortedError",
        *["call ok"] * 300,
    ]
    assert len(groups(svg, "attempt")) == 601


def test_what_took_longer_is_longer() -> None:
    svg = draw([call(GOOD, end=5.0)])
    (attempt,) = groups(svg, "attempt")
    server, *_, executing = (float(str(bar.get("width"))) for bar in attempt.iter(f"{SVG}rect"))
    assert executing == pytest.approx(2 * server, abs=0.02)
    texts = [text.text for text in ET.fromstring(svg).iter(f"{SVG}text")]
    assert "s since 1985-11-05 00:53:20.000 UTC" in texts


def test_an_empty_log() -> None:
    assert groups(draw([]), "call ") == []


def test_it_stands_by_itself() -> None:
    svg = draw([call(RETRIED, end=9.0)], name="goals.jsonl")
    root = ET.fromstring(svg)
    assert root.tag == f"{SVG}svg"
    assert not list(root.iter(f"{SVG}script"))
    assert "href" not in svg
    assert re.findall(r"https?://[^\"]+", svg) == ["http://www.w3.org/2000/svg"]


def names_beside(names: list[str]) -> list[str]:
    calls = [call(GOOD, number=n, end=5.0, action_name=name) for n, name in enumerate(names, 1)]
    rows = groups(draw(calls), "call ")
    return [str(next(t.text for t in row.iter(f"{SVG}text") if t.get("x") == "16")) for row in rows]


def test_names_that_fit_are_whole() -> None:
    names = ["/left_arm/follow_joint_trajectory", "/right_arm/follow_joint_trajectory", "/dock"]
    assert names_beside(names) == names


def test_what_is_beside_the_lanes_does_not_overlap() -> None:
    long = [f"/{arm}/{'w' * 60}/follow_joint_trajectory" for arm in ("left", "right")]
    for names in (["/a", "/b"], ["/left_arm/follow", "/dock"], long):
        calls = [call(GOOD, number=n, action_name=name) for n, name in enumerate(names, 1)]
        (row, *_) = groups(draw(calls), "call ")
        name, goal = list(row.iter(f"{SVG}text"))[:2]
        end = float(str(name.get("x"))) + 7.0 * len(str(name.text))
        assert end < float(str(goal.get("x"))) - 7.5 * len(str(goal.text))


@given(st.lists(st.text("/ab", min_size=1, max_size=60), unique=True, max_size=8))
def test_different_names_stay_different(names: list[str]) -> None:
    for most in (12, 40):
        short = shortened(names, most)
        assert list(short) == names
        assert len(set(short.values())) == len(names)
        for name, shown_as in short.items():
            assert shown_as == name or len(shown_as) <= most < len(name)


def test_the_end_of_a_name_is_kept_and_its_beginning_where_it_tells_two_apart() -> None:
    assert shortened(["/left/drive_home", "/dock_here"], 12) == {
        "/left/drive_home": "…/drive_home",
        "/dock_here": "/dock_here",
    }
    alike = [f"/{arm}_arm/joint_trajectory" for arm in ("left", "right")]
    assert list(shortened(alike, 12).values()) == ["/l…rajectory", "/r…rajectory"]
    inside = [f"/arms_of_the_robot/{arm}_arm/joint_trajectory" for arm in ("left", "next")]
    assert list(shortened(inside, 12).values()) == ["1: …ajectory", "2: …ajectory"]


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
    svg = draw(calls)
    assert len(groups(svg, "call ")) == len(calls)
    for attempt in groups(svg, "attempt"):
        bars = [float(str(bar.get("x"))) for bar in attempt.iter(f"{SVG}rect")]
        assert bars == sorted(bars)
    assert svg == draw(calls)


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


def test_a_notebook_shows_the_text_and_the_picture() -> None:
    timeline = Timeline(line.event for line in call(GOOD) if line.event is not None)
    error = ak.GoalAbortedError("It hit <a wall>.")
    outcome = Outcome(S.ABORTED, None, error, 1, timeline, timeline[0].goal_id, None, elapsed=6.0)
    for shown_as, ends in ((timeline, 0), (outcome, 1)):
        html = str(shown_as._repr_html_())
        text, image = html.split("</pre>")
        assert escape(str(timeline)) in text
        assert text.count("GoalAbortedError: It hit &lt;a wall&gt;.") == ends
        (data,) = re.findall(r'src="data:image/svg\+xml;base64,(.*?)"', image)
        assert shown(groups(b64decode(data).decode(), "attempt")[0]).endswith("succeeded")
    assert "(no events)" in str(Timeline()._repr_html_())


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
    done = forked.run(
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
    with pytest.raises(Problem, match="is no log of goals") as caught:
        run(__file__)
    assert caught.value.code == 1


def test_calls_are_grouped_by_action_and_times_of_several_goals_are_marked() -> None:
    def goal(number: int, began: float, end: float, name: str) -> list[LoggedLine]:
        steps = [(0.0, S.SENDING, 1), (0.1, S.ACCEPTED, 1), (end - began, S.SUCCEEDED, 1)]
        return call(steps, number=number, began=began, end=end - began, action_name=name)

    calls = [
        goal(1, 0.0, 4.0, "/arm"),
        goal(2, 1.0, 9.0, "/base"),
        goal(3, 2.0, 3.0, "/arm"),
        goal(4, 3.5, 6.0, "/arm"),
        goal(5, 6.0, 7.0, "/arm"),
    ]
    arm, base = lay_out(calls).groups
    assert [row.start for row in arm.rows] == [0.0, 2.0, 3.5, 6.0]
    assert [row.action_name for row in base.rows] == ["/base"]
    assert arm.together == [
        (pytest.approx(2.1), pytest.approx(3.0)),
        (pytest.approx(3.6), pytest.approx(4.0)),
    ]
    assert base.together == []
    svg = draw(calls)
    assert svg.count('class="together"') == 3  # two, and the legend
    assert svg.count('class="border"') == 1


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

"""JSON lines: complete, rotated and read back, also from damaged files (C6.2)."""

from __future__ import annotations

import dataclasses
import json
import re
import threading
import uuid
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import actionkit as ak
from actionkit import CallInfo, GoalEvent, GoalState, JsonLines, Outcome, Timeline, read_json_lines
from actionkit._observers.json_schema import event_line, outcome_line, parse_line

GOAL = uuid.UUID(int=7)
CALL = CallInfo(GOAL, "/fibonacci", "test_msgs/action/Fibonacci", "", 100.0, 5e8)


def event(number: int = 0, state: GoalState = GoalState.SENT, detail: str = "") -> GoalEvent:
    return GoalEvent(GOAL, 1, state, 100.0 + number, 5e8 + number, detail)


def numbers(log: ak.LogFile) -> list[float]:
    return [line.event.monotonic - 100 for line in log.lines if line.event is not None]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "goals.jsonl"


# --- the schema --------------------------------------------------------------------------------

TIMES = st.floats(-1e11, 1e11)
EVENTS = st.builds(
    GoalEvent,
    goal_id=st.uuids(),
    attempt=st.integers(1),
    state=st.sampled_from(GoalState),
    monotonic=TIMES,
    wall=TIMES,
    detail=st.text(st.characters()),  # lone surrogates included
    cancel_refused=st.booleans(),
)


@settings(deadline=None)  # a busy machine is no error
@given(EVENTS, st.text(), st.text(), st.text())
def test_an_event_comes_back_as_it_was(
    event: GoalEvent, action_name: str, action_type: str, node_name: str
) -> None:
    call = dataclasses.replace(
        CALL, action_name=action_name, action_type=action_type, node_name=node_name
    )
    text = event_line(event, call)
    assert "\n" not in text
    assert text.isascii()
    line = parse_line(text)
    assert line.event == event
    assert (line.kind, line.call_id) == ("event", GOAL)
    assert (line.action_name, line.action_type, line.node_name) == (
        action_name,
        action_type,
        node_name,
    )


@settings(deadline=None)  # a busy machine is no error
@given(EVENTS, st.data())
def test_a_line_that_was_cut_anywhere_is_no_line(event: GoalEvent, data: st.DataObject) -> None:
    text = event_line(event, CALL)
    cut = text[: data.draw(st.integers(0, len(text) - 1))]
    with pytest.raises(ValueError, match="cut off"):
        parse_line(cut)


def test_the_line_of_an_event() -> None:
    line = json.loads(event_line(event(1, detail="why"), CALL, goal={"order": 3}))
    assert line.pop("pid") > 0
    assert line == {
        "v": 1,
        "kind": "event",
        "call_id": str(GOAL),
        "action_name": "/fibonacci",
        "action_type": "test_msgs/action/Fibonacci",
        "node_name": "",
        "goal_id": str(GOAL),
        "attempt": 1,
        "state": "SENT",
        "monotonic": 101.0,
        "wall": 5e8 + 1,
        "elapsed_ms": 1000.0,
        "detail": "why",
        "cancel_refused": False,
        "goal": {"order": 3},
    }


def test_the_line_of_an_outcome() -> None:
    error = ak.GoalAbortedError("It was aborted.")
    confirmed = ak.CancelReport.CONFIRMED
    goals = tuple(ak.GoalReport(GOAL, fate) for fate in (ak.GoalFate.LOST, ak.GoalFate.ENDED))
    end = Outcome(GoalState.ABORTED, None, error, 2, Timeline(), GOAL, confirmed, 1, 5, 2.5, goals)
    line = json.loads(outcome_line(end, CALL, {"sequence": [1]}))
    del line["pid"]
    assert line == {
        "v": 1,
        "kind": "outcome",
        "call_id": str(GOAL),
        "action_name": "/fibonacci",
        "action_type": "test_msgs/action/Fibonacci",
        "node_name": "",
        "goal_id": str(GOAL),
        "state": "ABORTED",
        "monotonic": 102.5,
        "wall": 5e8 + 2.5,
        "elapsed_ms": 2500.0,
        "ok": False,
        "outcome": "GoalAbortedError",
        "error": "It was aborted.",
        "attempts": 2,
        "cancel": "CONFIRMED",
        "may_run": [str(GOAL)],
        "feedback_count": 5,
        "callback_errors": 1,
        "result": {"sequence": [1]},
    }
    assert parse_line(json.dumps({**line, "pid": 1})).event is None


def test_numbers_that_json_does_not_have() -> None:
    strange = {"x": [float("nan"), float("inf"), {"y": float("-inf")}], "z": 1.5}
    line = json.loads(event_line(event(), CALL, feedback=strange), parse_constant=pytest.fail)
    assert line["feedback"] == {"x": ["NaN", "Infinity", {"y": "-Infinity"}], "z": 1.5}


GOOD: dict[str, Any] = json.loads(event_line(event(), CALL))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[]", "no line of ActionKit's"),
        ('{"a": 1}', "no line of ActionKit's"),
        (json.dumps({**GOOD, "v": 2}), "of version 2"),
        (json.dumps({**GOOD, "state": "FLYING"}), "FLYING"),
        (json.dumps({**GOOD, "goal_id": 5}), "strange form"),
        (json.dumps({**GOOD, "wall": None}), "strange form"),
        (json.dumps({**GOOD, "kind": "outcome"}), "strange form"),
        (json.dumps({k: v for k, v in GOOD.items() if k != "call_id"}), "call_id"),
    ],
)
def test_what_is_no_line_says_why(text: str, said: str) -> None:
    with pytest.raises(ValueError, match=re.escape(said)):
        parse_line(text)


def raw(name: str, value: str) -> str:
    """Return a good line in which a field's value is written so, JSON or not."""
    return json.dumps({**GOOD, name: "HERE"}).replace('"HERE"', value)


HOSTILE = {
    "deep": "[" * 200_000,
    "deep and whole": raw("goal", "[" * 200_000 + "]" * 200_000),
    "a deep kind": raw("kind", "[" * 900 + "]" * 900),
    "a time too large for a float": raw("monotonic", str(10**400)),
    "a time that Python does not read": raw("wall", "9" * 5000),
    "a time that becomes infinite": raw("wall", "1e400"),
    "no number": raw("monotonic", "NaN"),
    "infinite": raw("elapsed_ms", "-Infinity"),
    "the word": raw("monotonic", '"nan"'),
    "a number in quotes": raw("monotonic", '"5"'),
    "true": raw("wall", "true"),
    "after the end of the world": raw("wall", "1e16"),
    "an infinite attempt": raw("attempt", "Infinity"),
    "an infinite process": raw("pid", "Infinity"),
    "a long version": raw("v", json.dumps("x" * 100_000)),
    "a long state": raw("state", json.dumps("x" * 100_000)),
    "no UTF-8": '"\udcff"',
}


@pytest.mark.parametrize("text", HOSTILE.values(), ids=HOSTILE)
def test_one_hostile_line_is_a_problem_and_no_more(text: str, path: Path) -> None:
    good = json.dumps(GOOD)
    path.write_bytes("\n".join([good, text, good]).encode("utf-8", "surrogateescape"))
    log = read_json_lines(path)
    assert [line.event for line in log.lines] == [event(), event()]
    (problem,) = log.problems
    assert problem.startswith("goals.jsonl:2: ")
    assert len(problem) < 400


ANYTHING = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.floats(),
    st.text(max_size=5),
    st.lists(st.none(), max_size=2),
    st.sampled_from([10**400, -(10**400), {"a": [1]}, "event", "outcome"]),
)


@settings(deadline=None)  # a busy machine is no error
@given(st.dictionaries(st.sampled_from(sorted(GOOD)), ANYTHING, min_size=1, max_size=4))
def test_any_values_make_a_line_or_a_problem(values: dict[str, Any]) -> None:
    try:
        line = parse_line(json.dumps({**GOOD, **values}))
    except ValueError:
        return
    assert (line.event is None) == (line.kind != "event")


def test_fields_may_be_added() -> None:
    assert parse_line(json.dumps({**GOOD, "new": 1})).event == event()


# --- the file ----------------------------------------------------------------------------------


def test_every_line_is_in_the_file_at_once(path: Path) -> None:
    with JsonLines(path) as log:
        for number in range(3):
            log.on_event(event(number), CALL)
            assert len(path.read_bytes().splitlines()) == number + 1
    assert numbers(read_json_lines(path)) == [0, 1, 2]


def test_it_appends(path: Path) -> None:
    for number in range(3):
        with JsonLines(path) as log:
            log.on_event(event(number), CALL)
    assert numbers(read_json_lines(path)) == [0, 1, 2]


def test_an_event_after_close_is_not_lost(path: Path) -> None:
    log = JsonLines(path)
    log.on_event(event(0), CALL)
    log.close()
    log.close()
    log.on_event(event(1), CALL)
    assert numbers(read_json_lines(path)) == [0, 1]
    log.close()


def test_a_cut_off_line_is_told_and_does_not_spoil_the_next(path: Path) -> None:
    with JsonLines(path) as log:
        log.on_event(event(0), CALL)
    whole = path.read_bytes()
    path.write_bytes(whole + whole[:57])
    read = read_json_lines(path)
    assert numbers(read) == [0]
    assert read.problems == ("goals.jsonl:2: 57 bytes, cut off, or no JSON",)
    with JsonLines(path) as log:
        log.on_event(event(1), CALL)
    read = read_json_lines(path)
    assert numbers(read) == [0, 1]
    assert read.problems == ("goals.jsonl:2: 57 bytes, cut off, or no JSON",)


def test_a_last_line_that_lacks_only_its_end_is_whole(path: Path) -> None:
    with JsonLines(path) as log:
        log.on_event(event(0), CALL)
    path.write_bytes(path.read_bytes().rstrip(b"\n"))
    read = read_json_lines(path)
    assert (numbers(read), read.problems) == ([0], ())


def test_it_rotates_by_size_and_is_read_whole(path: Path) -> None:
    size = len(event_line(event(10), CALL)) + 1
    with JsonLines(path, max_bytes=3 * size, backups=2) as log:
        for number in range(10, 18):
            log.on_event(event(number), CALL)
    names = sorted(each.name for each in path.parent.iterdir())
    assert names == ["goals.jsonl", "goals.jsonl.1", "goals.jsonl.2"]
    assert all(each.stat().st_size <= 3 * size for each in path.parent.iterdir())
    read = read_json_lines(path)
    assert (numbers(read), read.problems) == ([float(n) for n in range(10, 18)], ())
    with JsonLines(path, max_bytes=3 * size, backups=2) as log:
        for number in range(18, 20):
            log.on_event(event(number), CALL)
    assert numbers(read_json_lines(path)) == [float(n) for n in range(13, 20)]


def test_more_than_nine_backups_are_read_in_order(path: Path) -> None:
    with JsonLines(path, max_bytes=1, backups=20) as log:  # a line each
        for number in range(15):
            log.on_event(event(number), CALL)
    assert numbers(read_json_lines(path)) == [float(n) for n in range(15)]


def test_without_backups_what_is_full_goes(path: Path) -> None:
    with JsonLines(path, max_bytes=1, backups=0) as log:
        for number in range(3):
            log.on_event(event(number), CALL)
    assert numbers(read_json_lines(path)) == [2]
    assert len(list(path.parent.iterdir())) == 1


def test_a_process_killed_between_two_renamings_loses_nothing(path: Path) -> None:
    with JsonLines(path, max_bytes=1, backups=3) as log:
        for number in range(3):
            log.on_event(event(number), CALL)
    path.with_name("goals.jsonl.2").rename(path.with_name("goals.jsonl.3"))
    path.rename(path.with_name("goals.jsonl.1"))
    path.with_name("goals.jsonl.other").write_text("not ours")
    assert numbers(read_json_lines(path)) == [0, 2]


def test_any_number_of_threads_may_share_it(path: Path) -> None:
    with JsonLines(path, max_bytes=20_000, backups=1000) as log:

        def write(first: int) -> None:
            for number in range(first, first + 250):
                log.on_event(event(number), CALL)

        threads = [threading.Thread(target=write, args=(1000 * n,)) for n in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    read = read_json_lines(path)
    assert read.problems == ()
    for n in range(4):
        own = [number for number in numbers(read) if number // 1000 == n]
        assert own == [float(number) for number in range(1000 * n, 1000 * n + 250)]


def test_the_disk_may_be_full(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import os

    log, write = JsonLines(path), os.write
    log.on_event(event(0), CALL)

    def full(file: int, data: bytes) -> int:
        monkeypatch.setattr(os, "write", no_space)
        return write(file, bytes(data)[:20])

    def no_space(file: int, data: bytes) -> int:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "write", full)
    with pytest.raises(OSError, match="No space"):
        log.on_event(event(1), CALL)
    monkeypatch.setattr(os, "write", write)
    log.on_event(event(2), CALL)
    log.close()
    read = read_json_lines(path)
    assert numbers(read) == [0, 2]
    assert len(read.problems) == 1


def test_it_does_not_leak_its_file(path: Path) -> None:
    import os

    before = len(os.listdir("/proc/self/fd"))
    for _ in range(5):
        JsonLines(path).on_event(event(0), CALL)
    assert len(os.listdir("/proc/self/fd")) == before


@pytest.mark.parametrize(
    ("options", "error"),
    [
        ({"max_bytes": 0}, ValueError),
        ({"max_bytes": "10 MB"}, TypeError),
        ({"backups": -1}, ValueError),
        ({"backups": None}, TypeError),
        ({"backups": True}, TypeError),
        ({"max_items": 0}, ValueError),
        ({"messages": "no"}, TypeError),
    ],
)
def test_bad_options_are_refused(path: Path, options: Any, error: type[Exception]) -> None:
    with pytest.raises(error, match=next(iter(options))):
        JsonLines(path, **options)
    assert not path.exists()


@pytest.mark.parametrize("wrong", [3, None, b"goals.jsonl", True])
def test_a_path_that_is_none_is_refused(wrong: Any) -> None:
    with pytest.raises(TypeError, match=r"^JsonLines: path=.* must be a string or a path$"):
        JsonLines(wrong)


def test_a_folder_that_does_not_exist_is_told_at_once(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        JsonLines(tmp_path / "nowhere" / "goals.jsonl")
    with pytest.raises(FileNotFoundError):
        read_json_lines(tmp_path / "nothing.jsonl")


def test_calls_and_timelines(path: Path) -> None:
    other = dataclasses.replace(CALL, call_id=uuid.UUID(int=8))
    states = [GoalState.SENDING, *[GoalState.FEEDBACK] * 5, GoalState.SUCCEEDED]
    with JsonLines(path) as log:
        for number, state in enumerate(states):
            log.on_event(event(number, state), CALL)
            log.on_event(event(number, GoalState.SENT), other)
    read = read_json_lines(path)
    assert {call: len(lines) for call, lines in read.calls().items()} == {
        CALL.call_id: 7,
        other.call_id: 7,
    }
    kept = [e.state for e in read.timelines()[CALL.call_id]]
    assert kept == [states[0], GoalState.FEEDBACK, GoalState.FEEDBACK, states[-1]]

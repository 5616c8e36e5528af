"""Recordings of `ros2 bag`: their goals, their forms, and those that are damaged (C6.3)."""

from __future__ import annotations

import itertools
import json
import os
import random
import sqlite3
import sys
import threading
import xml.etree.ElementTree as ET
from collections.abc import Callable
from datetime import datetime, timezone
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from rosbags.rosbag2 import StoragePlugin

import actionkit as ak
from actionkit import GoalState
from actionkit._recordings.bag_fields import Fields
from actionkit.cli._app import app
from tests.docs.snippets import run_page
from tests.recordings import bags

DOCS = Path(__file__).parents[2] / "docs"
GUIDE, PICTURE = DOCS / "guides" / "what-happened.md", DOCS / "pictures" / "night.svg"
S = GoalState
ORDERS = [8, 5, 3, 60, 12, 20, 9, 50]
"""Of the recorded goals; see `record_kilted`."""
STATES = [
    S.SUCCEEDED, S.SUCCEEDED, S.ABORTED, S.REJECTED,
    S.SUCCEEDED, S.CANCELED, S.SUCCEEDED, S.EXECUTING,
]  # fmt: skip


def timeline(*arguments: object) -> Result:
    return CliRunner().invoke(app, ["timeline", *map(str, arguments)], standalone_mode=False)


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Eight goals, with service events and types."""
    return bags.mcap(tmp_path_factory.mktemp("bag") / "night.mcap", bags.night())


def only(messages: list[bags.Message], *kinds: str) -> list[bags.Message]:
    return [each for each in messages if each.topic.partition("/_action/")[2] in kinds]


def test_a_recording_with_service_events_tells_all(recording: Path) -> None:
    goals = ak.read_goals(recording)
    assert [goal.goal for goal in goals] == [{"order": order} for order in ORDERS]
    assert [goal.state for goal in goals] == STATES
    assert [goal.action_name for goal in goals] == [
        "/navigate" if order in (8, 12) else "/move_arm" for order in ORDERS
    ]
    assert goals[1].result == {"sequence": [0, 1, 1, 2, 3, 5, 8]}
    assert {goal.action_type for goal in goals} == {bags.FIBONACCI}
    mission, operator = dict.fromkeys(goal.sent_by for goal in goals)
    assert [
        order for goal, order in zip(goals, ORDERS, strict=True) if goal.sent_by == operator
    ] == [60, 9]
    assert mission.startswith("program 010f")
    first, rejected, last = goals[0], goals[3], goals[-1]
    assert first.accepted
    assert first.ended
    assert first.began < first.accepted < first.ended < first.began + 2
    assert rejected.accepted is None
    assert (last.result, last.ended) == (None, None)
    assert goals.problems == ()

    cancelled, refused = ([e for e in goal.timeline if "cancel" in e.detail] for goal in goals[5:7])
    assert [event.detail for event in cancelled] == [
        f"{operator} asks to cancel it",
        "the server agrees to cancel it",
        f"{mission} asks to cancel it",
    ]
    assert goals[5].timeline[-1].detail == "the server answers that it had ended"
    assert [event.detail for event in refused] == [
        f"{mission} asks to cancel it",
        "the server refuses to cancel it",
    ]
    assert [event.cancel_refused for event in refused] == [False, True]


def test_each_goal_begins_with_its_request_though_topics_are_not_in_step(tmp_path: Path) -> None:
    draw = random.Random(1)
    late = [m._replace(stamp=m.stamp + draw.randrange(20_000_000)) for m in bags.night()]
    late.sort(key=lambda message: message.stamp)
    goals = ak.read_goals(bags.mcap(tmp_path / "x.mcap", late))
    assert {goal.timeline[0].state for goal in goals} == {S.SENT}
    assert [goal.state for goal in goals] == STATES


def without_metadata(path: Path) -> Path:
    bag = bags.folder(path / "bag", bags.night(), StoragePlugin.MCAP)
    (bag / "metadata.yaml").unlink()
    return bag


def without_end(path: Path) -> Path:
    """Cut a file just before its footer, as a recorder that is killed leaves it."""
    path.write_bytes(path.read_bytes()[:-40])
    return path


def split(path: Path) -> Path:
    """Write three files, of which the tenth is the last."""
    messages = bags.night()
    (path / "bag").mkdir()
    for number, part in {2: messages[:20], 9: messages[20:50], 10: messages[50:]}.items():
        bags.mcap(path / "bag" / f"bag_{number}.mcap", part)
    return path / "bag"


FORMS: dict[str, Callable[[Path], Path]] = {
    "a folder with mcap": lambda path: bags.folder(path / "bag", bags.night(), StoragePlugin.MCAP),
    "a folder with db3": lambda path: bags.folder(
        path / "bag", bags.night(), StoragePlugin.SQLITE3
    ),
    "a folder of a recorder that was killed": without_metadata,
    "one db3": lambda path: next(
        bags.folder(path / "bag", bags.night(), StoragePlugin.SQLITE3).glob("*.db3")
    ),
    "without an index": lambda path: without_end(bags.mcap(path / "x.mcap", bags.night())),
    "in small chunks": lambda path: bags.mcap(path / "x.mcap", bags.night(), chunk=300),
    "split": split,
}


@pytest.mark.parametrize("form", FORMS)
def test_each_form_of_a_recording_tells_the_same(
    form: str, recording: Path, tmp_path: Path
) -> None:
    goals, same = ak.read_goals(FORMS[form](tmp_path)), ak.read_goals(recording)
    assert goals == same
    cut = form == "without an index"
    assert [("cut off" in problem) for problem in goals.problems] == ([True] if cut else [])


def test_without_types_the_states_are_told(recording: Path, tmp_path: Path) -> None:
    bare = bags.mcap(tmp_path / "jazzy.mcap", bags.night(), types=False)
    goals = ak.read_goals(bare)
    assert [goal.state for goal in goals] == [goal.state for goal in ak.read_goals(recording)]
    assert {goal.goal for goal in goals} == {None}
    assert goals.problems == (
        f"The fields of {bags.FIBONACCI} are not shown: the types are not recorded, or cannot be"
        " decoded.",
    )


def test_status_and_feedback_alone_tell_the_states(tmp_path: Path) -> None:
    path = bags.mcap(tmp_path / "x.mcap", only(bags.night(), "status", "feedback"))
    goals = ak.read_goals(path)
    assert [goal.state for goal in goals] == [s for s in STATES if s is not S.REJECTED]
    assert {goal.sent_by for goal in goals} == {""}
    assert "ros2 bag record --actions /move_arm /navigate" in goals.problems[0]
    shown = timeline(path, "--last", 2)
    assert f"/move_arm ({bags.FIBONACCI})\n" in shown.output
    assert "FEEDBACK   #9" in shown.output
    assert "=> goal EXECUTING; no end of the goal in this log" in shown.output


@pytest.mark.parametrize(
    ("kinds", "told"),
    [
        (("status",), "--topics /move_arm/_action/feedback"),
        (("feedback",), "--topics /move_arm/_action/status"),
        ((), "ros2 bag record -a --include-hidden-topics"),
    ],
)
def test_what_was_not_recorded_is_told_with_what_records_it(
    kinds: tuple[str, ...], told: str, tmp_path: Path
) -> None:
    other = bags.Message("/odom", "nav_msgs/msg/Odometry", 10**18, bytes(100))
    path = bags.mcap(tmp_path / "x.mcap", [other, *only(bags.night(), *kinds)])
    assert told in "\n".join(ak.read_goals(path).problems)


def test_a_goal_that_ran_before_the_recording_has_its_acceptance(tmp_path: Path) -> None:
    status = [m for m in only(bags.night(), "status") if m.topic.startswith("/navigate")]
    (late,) = ak.read_goals(bags.mcap(tmp_path / "x.mcap", status[2:3]))
    assert late.state is S.SUCCEEDED
    assert late.timeline[-1].detail == "it had ended when the recording began"
    (running,) = ak.read_goals(bags.mcap(tmp_path / "y.mcap", status[1:2]))
    assert (running.state, running.ended) == (S.EXECUTING, None)
    assert running.accepted
    assert running.accepted < status[1].stamp * 1e-9


def test_of_much_feedback_a_part_is_kept_with_the_first_and_the_last(tmp_path: Path) -> None:
    messages = bags.night()
    last = next(m for m in reversed(messages) if m.topic == "/move_arm/_action/feedback")
    more = [last._replace(stamp=last.stamp + 10**7 * n) for n in range(1, 5000)]
    shown = timeline(bags.mcap(tmp_path / "x.mcap", messages + more), "--last", 1, "--json")
    lines = [json.loads(line) for line in shown.output.splitlines()]
    numbers = [int(line["detail"][1:]) for line in lines if line["state"] == "FEEDBACK"]
    assert (numbers[0], numbers[-1]) == (1, 11 + 4999)
    assert 150 < len(numbers) <= 301
    assert len({b - a for a, b in itertools.pairwise(numbers[:-1])}) == 1


def test_files_that_are_missing_are_told(tmp_path: Path) -> None:
    folder = bags.folder(tmp_path / "bag", bags.night(), StoragePlugin.MCAP)
    (name,) = (path.name for path in folder.glob("*.mcap"))
    other = bags.mcap(folder / "bag_7.mcap", bags.night()[:5])
    (folder / name).rename(folder / f"{name}.zstd")
    written(folder / "bag_8.db3", b"")
    told = ak.read_goals(folder).problems[:3]
    assert [problem.partition(": ")[2] for problem in told] == [
        f"{folder / name}.zstd: run `zstd -d {folder / name}.zstd`",
        str(folder / "bag_8.db3"),
        f"{folder / name}: no such file",
    ]
    assert other.exists()


def test_a_log_can_come_from_a_pipe(recording: Path, tmp_path: Path) -> None:
    log = timeline(recording, "--json").output
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    writer = threading.Thread(target=pipe.write_text, args=(log,))
    writer.start()
    goals = ak.read_goals(pipe)
    writer.join(20)
    assert (len(goals), goals.problems) == (8, ())


def test_constants_are_not_fields(tmp_path: Path) -> None:
    text = bags.DEFINITION.replace(
        "int32[] sequence\n---\n#feedback",
        "int32 NONE=0\nint32 BAD=7\nint32[] sequence\n---\n#feedback",
    )
    assert text != bags.DEFINITION
    fields = Fields({f"{bags.FIBONACCI}_GetResult_Event": text})
    event = next(
        m for m in bags.night() if m.ros_type.endswith("GetResult_Event") and len(m.data) > 80
    )
    assert fields.result(bags.FIBONACCI, event.data) == {
        "sequence": [0, 1, 1, 2, 3, 5, 8, 13, 21, 34]
    }


@pytest.mark.long
def test_the_page_of_the_guide(tmp_path: Path) -> None:
    bags.folder(tmp_path / "rosbag2_2026_12_01-00_04_20", bags.night(), StoragePlugin.MCAP)
    run_page(GUIDE, tmp_path)


# --- damaged files -------------------------------------------------------------------------------


@pytest.mark.parametrize("part", range(1, 20))
def test_what_a_cut_recording_has_is_read(part: int, recording: Path, tmp_path: Path) -> None:
    whole = bags.mcap(tmp_path / "x.mcap", bags.night(), chunk=500)
    data = whole.read_bytes()
    whole.write_bytes(data[: len(data) * part // 20])
    goals = ak.read_goals(whole)
    known = {goal.goal_id for goal in ak.read_goals(recording)}
    assert {goal.goal_id for goal in goals} <= known
    assert any("cut off" in problem for problem in goals.problems)
    assert part < 10 or len(goals) > 2
    shown = timeline(whole)
    assert shown.return_value == (0 if goals else 1)
    assert "cut off" in shown.stderr


def test_a_chunk_that_is_damaged_hides_no_other(tmp_path: Path) -> None:
    path = bags.mcap(tmp_path / "x.mcap", bags.night(), chunk=3000)
    data = bytearray(path.read_bytes())
    middle = len(data) // 3
    data[middle : middle + 20] = bytes(20)
    path.write_bytes(data)
    goals = ak.read_goals(path)
    assert goals[0].goal == {"order": ORDERS[0]}
    assert goals[-1].goal == {"order": ORDERS[-1]}
    (problem,) = (each for each in goals.problems if "damaged" in each)
    assert problem.startswith("x.mcap")


@pytest.mark.parametrize("part", range(1, 10))
def test_what_a_cut_database_has_is_read(part: int, recording: Path, tmp_path: Path) -> None:
    (path,) = bags.folder(tmp_path / "bag", bags.night(), StoragePlugin.SQLITE3).glob("*.db3")
    data = path.read_bytes()
    path.write_bytes(data[: len(data) * part // 10])
    goals = ak.read_goals(path)
    told = any("cut off" in problem for problem in goals.problems)
    assert told or goals == ak.read_goals(recording)  # at the end is only an index


def test_messages_that_are_cut_off_hide_no_others(recording: Path, tmp_path: Path) -> None:
    draw = random.Random(2)
    messages = [
        m._replace(data=m.data[: draw.randrange(len(m.data))]) if draw.random() < 0.3 else m
        for m in bags.night()
    ]
    goals = ak.read_goals(bags.mcap(tmp_path / "x.mcap", messages))
    assert {goal.goal_id for goal in ak.read_goals(recording)} <= {goal.goal_id for goal in goals}
    assert any(" are cut off" in problem for problem in goals.problems)


# --- what is no recording ------------------------------------------------------------------------


def no_topics(path: Path) -> Path:
    connection = sqlite3.connect(path / "ledger.db")
    connection.execute("CREATE TABLE goals (id)")
    connection.close()
    return path / "ledger.db"


def written(path: Path, data: bytes) -> Path:
    path.write_bytes(data)
    return path


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda path: path, "is a folder without .mcap or .db3 files"),
        (lambda path: written(path / "x.txt", b"hello\n"), "no log of goals, and no recording"),
        (lambda path: written(path / "x.mcap", b"hello\n"), "not a recording"),
        (lambda path: written(path / "x.db3", b""), "not a recording"),
        (lambda path: written(path / "x.db3.zstd", b"x"), "run `zstd -d "),
        (lambda path: written(path / "x.mcap.zstd", b"x").parent, "run `zstd -d "),
    ],
)
def test_what_is_no_recording_is_a_clear_error(
    make: Callable[[Path], Path], said: str, tmp_path: Path
) -> None:
    path = make(tmp_path)
    with pytest.raises(ValueError, match=said):
        ak.read_goals(path)
    result = timeline(path)
    assert said in str(result.exception)


def test_a_database_of_something_else_has_no_goals(tmp_path: Path) -> None:
    shown = timeline(no_topics(tmp_path))
    assert shown.return_value == 1
    assert "no such table: topics" in shown.stderr


def test_what_to_install_is_told(
    recording: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "rosbags", None)
    with pytest.raises(ImportError, match="pip install mcap rosbags"):
        ak.read_goals(recording)


# --- the command ---------------------------------------------------------------------------------


def test_its_json_is_a_log_with_the_same_goals(recording: Path, tmp_path: Path) -> None:
    shown = timeline(recording, "--json")
    assert shown.return_value == 0
    log = written(tmp_path / "goals.jsonl", shown.output.encode())
    assert ak.read_goals(log) == ak.read_goals(recording)
    walls = [json.loads(line)["wall"] for line in shown.output.splitlines()]
    assert walls == sorted(walls)


def test_it_draws_the_picture_of_the_guide_which_a_notebook_shows(
    recording: Path, tmp_path: Path
) -> None:
    """With ACTIONKIT_WRITE_PICTURES=1 in the environment, the picture of the guide is written."""
    shown = timeline(recording, "--svg", tmp_path / "night.svg")
    assert "=> CANCELED after " in shown.output
    picture = (tmp_path / "night.svg").read_text()
    if os.environ.get("ACTIONKIT_WRITE_PICTURES") == "1":
        PICTURE.write_text(picture)
    assert picture == PICTURE.read_text()
    assert len(ET.fromstring(picture).findall(".//*[@class='attempt']")) == 8
    assert "image/svg+xml" in ak.read_goals(recording)._repr_html_()


@pytest.mark.parametrize(
    ("options", "orders"),
    [
        (["--action", "navigate"], [8, 12]),
        (["--action", "/move_arm", "--last", "2"], [9, 50]),
        (["--from", "{second}", "--to", "{third}"], [5, 3]),
        (["--from", "{date}"], ORDERS),
        (["--to", "{date}"], [8]),
        (["--to", "{clock}"], [8]),
    ],
)
def test_a_part_of_it_can_be_chosen(options: list[str], orders: list[int], recording: Path) -> None:
    began = [goal.began + 0.001 for goal in ak.read_goals(recording)]
    date = datetime.fromtimestamp(began[0], timezone.utc)
    places = {
        "date": date.isoformat(),
        "clock": f"{date:%H:%M:%S.%f}",
        "second": str(began[1] - began[0]),
        "third": str(began[2] - began[0]),
    }
    filled = [each.format(**places) for each in options]
    shown = timeline(recording, *filled, "--json")
    sent = [json.loads(line) for line in shown.output.splitlines()]
    assert [each["goal"]["order"] for each in sent if "goal" in each] == orders


def test_a_choice_without_goals_names_what_there_is(recording: Path) -> None:
    shown = timeline(recording, "--action", "/arm")
    assert shown.return_value == 1
    assert "no such goals in it, but goals of /move_arm, /navigate" in shown.stderr


def test_a_time_that_is_none_is_refused(recording: Path) -> None:
    shown = timeline(recording, "--from", "yesterday")
    assert "'yesterday' is no time" in str(shown.exception)

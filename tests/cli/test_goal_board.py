"""The goals that `actionkit watch` keeps."""

from __future__ import annotations

import contextlib
import queue
import re
import time
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest
from rich.console import Console

from actionkit._ros.endpoints import graph
from actionkit._ros.endpoints.names import ActionNames
from actionkit._ros.others_goals.goal_board import Board
from actionkit._ros.others_goals.server_numbers import ServerNumbers
from actionkit._ros.others_goals.watch import GoalSeen, StatusReader
from actionkit.cli.watch import _actions, watch
from actionkit.cli.watch._screens import TableScreen, Watched
from tests.unit.test_wire import status_array

EXECUTING, SUCCEEDED, CANCELED = 2, 4, 5


def goal(number: int, state: str, stamp: int = 0) -> GoalSeen:
    return GoalSeen(f"{number:032x}", state, stamp or number * 10**9)


def test_only_changes_are_told_and_what_ended_stays_so() -> None:
    board = Board()
    board.take([goal(1, "EXECUTING"), goal(2, "ACCEPTED")], 10.0)
    changed, _ = board.take([goal(1, "EXECUTING"), goal(2, "EXECUTING")], 11.0)
    assert [(row.state, row.before) for row in changed] == [("EXECUTING", "ACCEPTED")]
    board.take([goal(1, "SUCCEEDED")], 12.0)
    assert board.take([goal(1, "EXECUTING")], 13.0) == ([], False)
    board.take((), 14.0)
    board.take([goal(2, "SUCCEEDED")], 15.0)  # it was not lost after all
    assert board.counts() == {"SUCCEEDED": 2}


def drawn(board: Board, now: float = 1.0, name: str = "/a") -> str:
    console = Console(width=100)
    with console.capture() as capture:
        console.print(TableScreen(name)._drawn([Watched("/a", board)], (), now))
    return capture.get()


def test_a_status_without_goals_is_not_the_same_as_none() -> None:
    """A server of micro-ROS runs goals, and publishes no status of them."""
    board = Board()
    board.take(("/server",), 0.0)
    assert not board.has_status
    assert "no status yet" in drawn(board)
    board.take([], 1.0)
    assert board.has_status
    assert "no goals" in drawn(board)


def test_a_goal_that_two_servers_have_has_ended_where_both_have_ended_it() -> None:
    board = Board()
    board.take([goal(1, "EXECUTING", 10), goal(1, "EXECUTING", 11)], 1.0)
    assert board.take([goal(1, "CANCELED", 10)], 2.0) == ([], False)
    assert board.counts() == {"EXECUTING": 1}
    board.take([goal(1, "CANCELING", 11)], 3.0)
    assert board.counts() == {"CANCELING": 1}
    board.take([goal(1, "CANCELED", 10)], 4.0)
    assert board.counts() == {"CANCELING": 1}
    board.take([goal(1, "ABORTED", 11)], 5.0)
    assert board.counts() == {"ABORTED": 1}


def test_what_ended_on_one_server_may_turn_out_to_run_on_another() -> None:
    board = Board()
    board.take([goal(1, "SUCCEEDED", 10)], 1.0)
    changed, _ = board.take([goal(1, "EXECUTING", 11)], 2.0)
    assert [(row.state, row.before) for row in changed] == [("EXECUTING", "SUCCEEDED")]
    changed, _ = board.take((), 3.0)
    assert [row.state for row in changed] == ["LOST"]


@pytest.mark.parametrize("order", [1, -1])
def test_of_a_goal_that_two_servers_have_the_one_that_runs_is_told(order: int) -> None:
    board = Board()
    board.take([goal(1, "CANCELED", 10), goal(1, "EXECUTING", 11)][::order], 1.0)
    assert board.counts() == {"EXECUTING": 1}


class Inbox:
    """What a `StatusReader` reports, and when; its clock is that of the test."""

    def __init__(self, *news: tuple[float, Any]) -> None:
        self.now = 0.0
        self._news = list(news)

    def get(self, timeout: float) -> Any:
        at, news = self._news[0] if self._news else (float("inf"), None)
        if at > self.now + timeout:
            self.now += timeout
            raise queue.Empty
        self.now = max(self.now, at)
        del self._news[0]
        return news


@pytest.mark.parametrize(
    ("servers", "state"),
    [
        ([(0.5, ("/a",))], "SUCCEEDED"),
        ([(0.5, ("/a", "/b"))], "EXECUTING"),
        ([(0.5, ("/a",)), (0.8, ("/a", "/b"))], "EXECUTING"),
    ],
    ids=["one server", "two servers", "the second is seen when the first has told"],
)
def test_a_look_waits_for_the_goals_of_each_server_in_sight(
    servers: list[tuple[float, Any]], state: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    told = [(0.6, [goal(1, "SUCCEEDED", 10)]), (1.3, [goal(1, "EXECUTING", 11)])]
    inbox, board = Inbox(*sorted([*servers, *told], key=lambda each: each[0])), Board()
    clock = SimpleNamespace(monotonic=lambda: inbox.now, time=time.time)

    def take(timeout: float) -> None:
        with contextlib.suppress(queue.Empty):
            board.take(inbox.get(timeout), 0.0)

    monkeypatch.setattr(watch, "time", clock)
    watch.first_look(board, take, 5.0)
    assert board.counts() == {state: 1}
    assert inbox.now < 1.6


def test_apart_a_goal_that_two_servers_have_is_two_goals() -> None:
    board = Board(apart=True)
    ours, theirs = goal(1, "EXECUTING", 10), GoalSeen(goal(1, "").goal_id, "EXECUTING", 11, 2)
    board.take([ours, theirs], 1.0)
    changed, _ = board.take([replace(theirs, state="CANCELED")], 2.0)
    assert [(row.state, row.server) for row in changed] == [("CANCELED", 2)]
    assert board.counts() == {"EXECUTING": 1, "CANCELED": 1}


@pytest.mark.parametrize(("in_sight", "number"), [(1, 1), (2, 2)])
def test_another_server_is_told_from_one_that_forgets(in_sight: int, number: int) -> None:
    servers = ServerNumbers()
    ended, new = (b"1", 1, 0), (b"2", 2, 0)
    assert servers.of({ended: SUCCEEDED}, in_sight) == 1
    assert servers.of({new: EXECUTING}, in_sight) == number


def test_the_table_of_all_shows_ended_goals_for_half_a_minute() -> None:
    board = Board(apart=True)
    board.take([goal(1, "EXECUTING"), goal(2, "SUCCEEDED")], 100.0)
    assert all(word in drawn(board, 129.0, "") for word in ("/a", "EXECUTING", "SUCCEEDED"))
    assert "SUCCEEDED" not in drawn(board, 131.0, "")
    assert "SUCCEEDED" in drawn(board, 131.0, "/a")


def test_the_table_tells_which_of_several_servers_has_a_goal() -> None:
    board = Board(apart=True)
    board.take(("/arm", "/arm"), 0.0)
    board.take([replace(goal(1, "EXECUTING"), server=2)], 1.0)
    assert "2 of 2" in drawn(board)
    board.take(("/arm",), 2.0)
    board.take([goal(2, "EXECUTING")], 3.0)
    assert re.search(r"^/a +0{8}  EXECUTING .* /arm *$", drawn(board, name=""), re.M)


@pytest.mark.long
def test_the_board_is_bounded_and_keeps_what_runs() -> None:
    board = Board()
    board.take([goal(0, "EXECUTING")], 0.0)
    for number in range(1, 3000):
        board.take([goal(number, "SUCCEEDED")], float(number))
    assert len(board.goals) == 1000
    assert board.goals[f"{0:032x}"].state == "EXECUTING"
    assert f"{2999:032x}" in board.goals


def test_each_change_is_told_once(ros_domain: int, monkeypatch: pytest.MonkeyPatch) -> None:
    one, two = (bytes([number]) * 16 for number in (1, 2))
    told: list[Any] = []
    calls: list[list[GoalSeen]] = []

    def tell(goals: list[GoalSeen]) -> None:
        told.extend(goals)
        calls.append(goals)

    reader = StatusReader(ActionNames.of("/a"), on_goals=tell, on_servers=lambda _: None)
    runtime = reader._reader.runtime

    def come(*arrays: list[tuple[bytes, int]]) -> list[tuple[str, str]]:
        told.clear()
        runtime.run(lambda: reader._take([(0, status_array(array)) for array in arrays]))
        return [(goal.goal_id[:2], goal.state) for goal in told]

    def see(*nodes: str) -> None:
        ends = [SimpleNamespace(node=node) for node in nodes]
        monkeypatch.setattr(graph, "servers", lambda *_: ends)
        runtime.run(lambda: reader._look(runtime.node))

    try:
        see("/server")
        calls.clear()
        assert come([]) == []
        assert calls == [[]]  # that there is a status
        # A server that forgets goals at once shows an end in one array only.
        assert come([(one, EXECUTING)], [(one, SUCCEEDED)], [(two, EXECUTING)], []) == [
            ("01", "EXECUTING"),
            ("01", "SUCCEEDED"),
            ("02", "EXECUTING"),
        ]
        assert come([(two, EXECUTING)], [(two, CANCELED)]) == [("02", "CANCELED")]
        # All again when the servers have changed: they may have counted as lost.
        see("/server", "/other")
        assert come([(two, CANCELED)]) == [("02", "CANCELED")]
        # Not all again because another server tells of its goals.
        assert come([(one, EXECUTING)]) == [("01", "EXECUTING")]
        assert come([(two, CANCELED)], [(one, EXECUTING)]) == []
    finally:
        reader.close()


def test_an_action_is_read_until_it_has_been_gone_for_a_minute(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    counts, clock, closed = {"/a/_action/feedback": 1}, SimpleNamespace(now=0.0), []
    node = SimpleNamespace(count_publishers=lambda topic: counts.get(topic, 0))
    survey = SimpleNamespace(runtime=SimpleNamespace(node=node), names=ActionNames.of)
    reader = SimpleNamespace(close=lambda: closed.append(clock.now))
    monkeypatch.setattr(graph, "action_types", lambda _: {"/a": ["p/action/T"], "/b": []})
    monkeypatch.setattr(_actions, "StatusReader", lambda *_, **__: reader)
    monkeypatch.setattr(
        _actions, "time", SimpleNamespace(monotonic=lambda: clock.now, time=time.time)
    )
    actions = _actions.Actions(survey, "", feedback=False)  # type: ignore[arg-type]
    actions.look()
    assert {name: action.type for name, action in actions.by_name.items()} == {"/a": "p/action/T"}
    counts.clear()
    for clock.now in (59.0, 61.0):
        actions.look()
    assert (closed, actions.by_name) == ([61.0], {})

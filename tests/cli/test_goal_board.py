"""The goals that `actionkit watch` keeps."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from actionkit.cli._goal_board import Board


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

"""The goals that `actionkit watch` keeps."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from actionkit.cli._goal_board import Board


def goal(number: int, state: str) -> Any:
    return SimpleNamespace(goal_id=f"{number:032x}", state=state, accepted=float(number))


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


def test_the_board_is_bounded_and_keeps_what_runs() -> None:
    board = Board()
    board.take([goal(0, "EXECUTING")], 0.0)
    for number in range(1, 3000):
        board.take([goal(number, "SUCCEEDED")], float(number))
    assert len(board.goals) == 1000
    assert board.goals[f"{0:032x}"].state == "EXECUTING"
    assert f"{2999:032x}" in board.goals

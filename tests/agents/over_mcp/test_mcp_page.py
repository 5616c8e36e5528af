"""docs/maintainers/agents-faults.md has all its rows; all goals that can be cancelled are."""

from __future__ import annotations

from tests.agents.over_mcp.page import PAGE


def test_the_page_has_a_row_for_each_case_and_no_other() -> None:
    PAGE.check()


def test_no_goal_is_left_but_by_what_nobody_can_help() -> None:
    left = {
        fault
        for group in PAGE.tables
        for (fault, _), (reached, _, _) in PAGE.rows(group).items()
        if "runs on" in reached
    }
    assert left == {"the server is killed (SIGKILL)"}

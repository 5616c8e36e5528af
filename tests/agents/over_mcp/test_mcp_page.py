"""The page of agents' faults, docs/agents-faults.md, is the one that the tests write."""

from __future__ import annotations

from dataclasses import replace

import pytest

from tests.agents.over_mcp import page, table
from tests.agents.over_mcp.conftest import WRITING
from tests.agents.over_mcp.table import Case, Row

ROW = Row(Case("group", "it breaks", "stdio"), "a goal, canceled", "nothing")


@pytest.mark.skipif(WRITING, reason="docs/agents-faults.md is being written")
def test_the_page_has_a_row_for_each_case_and_no_other() -> None:
    text = table.PATH.read_text("utf-8")
    written = table.read(text)
    assert set(written) == set(page.cases())
    rows = [Row(case, *written[case]) for case in page.cases()]
    assert text == table.render(page.INTRO, page.GROUPS, rows)


@pytest.mark.skipif(WRITING, reason="docs/agents-faults.md is being written")
def test_no_goal_is_left_but_by_what_nobody_can_help() -> None:
    left = {
        case.fault
        for case, (reached, _, _) in table.read(table.PATH.read_text("utf-8")).items()
        if "runs on" in reached
    }
    assert left == {"SIGKILL", "the server is killed (SIGKILL)"}


def test_what_is_written_is_read_back() -> None:
    rows = [ROW, replace(ROW, case=replace(ROW.case, over="HTTP"))]
    rows.append(replace(ROW, case=replace(ROW.case, fault="another"), process="ends"))
    text = table.render("# Title", {"group": "What."}, rows)
    assert text.count("| it breaks | stdio; HTTP |") == 1
    assert table.read(text) == {row.case: row.seen for row in rows}

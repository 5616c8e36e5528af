"""The page of the fault lab, docs/faults.md, is the one that its tests write."""

from __future__ import annotations

from dataclasses import replace

import pytest

from tests.faults import page, table
from tests.faults.conftest import WRITING
from tests.faults.table import VARIES, Case, Row, Written

written = pytest.mark.skipif(WRITING, reason="docs/faults.md is being written")


@written
def test_the_page_has_a_row_for_each_case_and_no_other():
    text = table.PATH.read_text()
    assert set(table.read(text)) == set(page.cases())
    for fault, explanation in page.EXPLAINED.items():
        assert f"## {fault}\n\n{explanation.strip()}\n" in text
    assert text.startswith(page.INTRO.strip())


@written
def test_what_the_page_promises_holds_in_every_row():
    for case, row in table.read(table.PATH.read_text()).items():
        assert row.left == "0", case
        if case.policy != "always" and case.fault != page.TWINS:
            assert row.at_once in ("0", "1"), case
        if case.policy in ("no retries", "never_accepted") and case.fault != page.TWINS:
            assert row.executed in ("0", "1"), case


ROW = Row(Case("fault", "soon", "confirmed_stopped"), "result", 1.0, 2, 1, 0)


def test_what_is_written_is_read_back():
    rows = [ROW, replace(ROW, case=Case("fault", "soon", "no retries"))]
    rows.append(replace(ROW, case=Case("fault", "later", "always"), noticed=None))
    text = table.render("# Title", {"fault": "What."}, rows)
    assert text.count("\n| soon |") == 1  # for the two policies
    assert table.read(text) == {row.case: Written.of(row) for row in rows}


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({}, ""),
        ({"noticed": 0.1}, ""),
        ({"noticed": 2.1}, "noticed"),
        ({"noticed": None}, "noticed"),
        ({"outcome": "`ServerLostError`"}, "outcome"),
        ({"executed": 3}, "executed"),
        ({"at_once": 2}, "at_once"),
        ({"left": 1}, "left"),
    ],
)
def test_a_row_that_is_not_as_written_is_found(change, word):
    problem = Written.of(ROW).differs(replace(ROW, **change))
    assert word in problem
    assert bool(problem) == bool(word)


def test_only_the_rows_that_vary_leave_out_what_is_known_of_the_goal():
    assert set(page.cases()) > VARIES
    for case in VARIES:
        row = replace(ROW, case=case, outcome="result, attempt 2")
        known = replace(row, outcome="result, goal UNKNOWN, attempt 2")
        assert not Written.of(row).differs(known)
        assert "outcome" in Written.of(row).differs(replace(row, outcome="result, attempt 3"))
        elsewhere = replace(case, fault=page.KILL)
        other = Written.of(replace(row, case=elsewhere))
        assert "outcome" in other.differs(replace(known, case=elsewhere))

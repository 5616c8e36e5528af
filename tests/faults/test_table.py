"""docs/maintainers/faults.md has all its rows, and its promises are true."""

from __future__ import annotations

from dataclasses import replace

from tests.faults import attacks, page
from tests.faults.lab import TIMEOUTS
from tests.faults.table import LATE, VARIES, Case, Row
from tests.tables import limit


def test_the_page_has_a_row_for_each_case_and_no_other():
    page.PAGE.check()


def test_the_page_tells_the_timeouts():
    text = " ".join(page.PAGE.path.read_text().split())
    assert (
        f"`server={TIMEOUTS.server:g}`, `accept={TIMEOUTS.accept:g}`, `cancel={TIMEOUTS.cancel:g}`"
        f" and `result={TIMEOUTS.result:g}` seconds" in text
    )


def test_what_the_page_promises_holds_in_every_row():
    for fault in page.FAULTS:
        for (phase, policy), row in page.PAGE.rows(fault).items():
            _, noticed, executed, at_once = row
            case = Case(fault, phase, policy)
            assert noticed == "-" or limit(noticed) > 0, case
            if policy != "always" and fault != page.TWINS:
                assert at_once in ("0", "1"), case
            if policy in ("no retries", "never_accepted") and fault != page.TWINS:
                assert executed in ("0", "1"), case


def test_each_attack_has_a_limit():
    for section in attacks.TABLES:
        for key, (*_, delay) in page.PAGE.rows(section).items():
            assert limit(delay) > 0, key


def test_only_the_rows_that_vary_leave_out_what_is_known_of_the_goal():
    cases = {Case(fault, *key) for fault, keys in page.FAULTS.items() for key in keys}
    assert cases > VARIES
    for case in VARIES:
        row = Row(case, "result, attempt 2", 1.0, 2, 1, 0)
        known = replace(row, outcome="result, goal UNKNOWN, attempt 2")
        assert row.cells == known.cells
        assert row.cells[0] != replace(row, outcome="result, attempt 3").cells[0]
        elsewhere = replace(case, fault=page.KILL)
        assert replace(row, case=elsewhere).cells[0] == row.outcome
        assert replace(known, case=elsewhere).cells[0] == known.outcome


def test_in_a_long_outage_the_first_goal_may_be_the_one_with_the_result():
    for case in LATE:
        row = Row(case, "result", 20.0, 1, 1, 0)
        assert row.cells == replace(row, outcome="result, attempt 2").cells
        assert replace(row, case=replace(case, phase="before accept")).cells[0] == "result"


def test_how_many_goals_always_sends_is_a_matter_of_chance():
    row = Row(
        Case(page.STOP_LIVENESS, "during feedback", "always"), "result, attempt 3", 1, 2, 1, 0
    )
    assert row.cells[2:] == ("up to 3", "up to 3")
    assert replace(row, case=replace(row.case, policy="server_gone")).cells[2:] == ("2", "1")

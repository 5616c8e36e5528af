"""Tables in the documentation that tests write and check."""

from __future__ import annotations

import pytest

from tests import tables
from tests.tables import Page, Seconds

KEYS = [("soon", "once"), ("soon", "twice"), ("later", "once")]
SEEN = {key: ("result", Seconds(1.0), 0) for key in KEYS}
EMPTY = """<!-- table: kill -->

| phase | policy | outcome | noticed after | left |
|---|---|---|---|---|

<!-- end of table -->
"""


@pytest.fixture
def page(tmp_path, monkeypatch):
    monkeypatch.setattr(tables, "WRITING", False)
    found = Page(tmp_path / "page.md", {"kill": KEYS})
    found.path.write_text(EMPTY)
    found.write("kill", SEEN)
    return found


def test_what_is_written_is_as_seen(page):
    text = page.path.read_text()
    assert "\n| soon | once; twice | result | < 2 s | 0 |\n| later | once | result |" in text
    page.write("kill", {KEYS[1]: ("none", Seconds(100.0), 0)})
    assert page.rows("kill")[KEYS[1]] == ("none", "< 190 s", "0")
    page.write("kill", SEEN)
    assert page.rows("kill")[KEYS[1]] == ("result", "< 190 s", "0")  # a bound with room stays
    page.record("kill", SEEN)
    page.check()


@pytest.mark.parametrize(
    ("seen", "said"),
    [
        (("error", Seconds(0.1), 0), "'outcome' is 'error', and the page says 'result'"),
        (("result", Seconds(2.1), 0), "'noticed after' is '2.1 s', and the page says '< 2 s'"),
        (("result", "-", 0), "'noticed after' is '-', and the page says '< 2 s'"),
        (("result", Seconds(2.0), 1), "'left' is '1', and the page says '0'"),
    ],
)
def test_a_cell_that_differs_is_found(page, seen, said):
    with pytest.raises(
        AssertionError, match=r"ACTIONKIT_WRITE_TABLES=1 .* -n 0 .*test_tables"
    ) as e:
        page.record("kill", {**SEEN, KEYS[2]: seen})
    assert f"('later', 'once'): {said}\n" in str(e.value)


def test_a_row_that_is_missing_or_surplus_is_found(page):
    with pytest.raises(AssertionError, match="no such row"):
        page.record("kill", {("soon", "thrice"): SEEN[KEYS[0]]})
    with pytest.raises(AssertionError, match=r"rows are missing: .*'thrice'"):
        Page(page.path, {"kill": [*KEYS, ("soon", "thrice")]}).check()
    with pytest.raises(AssertionError, match=r"no test has the rows .*'later'"):
        Page(page.path, {"kill": KEYS[:2]}).check()
    with pytest.raises(AssertionError, match="another order"):
        Page(page.path, {"kill": KEYS[::-1]}).check()

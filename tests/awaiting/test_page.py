"""docs/awaiting.md has all its rows."""

from __future__ import annotations

from tests.awaiting.page import PAGE


def test_the_page_has_a_row_for_each_form_and_no_other():
    PAGE.check()

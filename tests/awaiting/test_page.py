"""That docs/awaiting.md is whole."""

from __future__ import annotations

import pytest

from tests.awaiting import page, table
from tests.awaiting.conftest import WRITING


@pytest.mark.skipif(WRITING, reason="docs/awaiting.md is being written")
def test_the_page_has_a_row_for_each_form_and_no_other():
    text = table.PATH.read_text()
    assert list(table.read(text)) == page.FORMS
    assert table.merge([], text) == text, "its words are not those of tests/awaiting/page.py"

"""The page "Where it runs" has what the tests of the combinations hold. Contract C13.1."""

from __future__ import annotations

import re

from tests.native.build import TOP
from tests.native.promises import PAGE, PROMISES


def test_the_page_has_a_row_for_each_promise_and_each_test_is_there() -> None:
    PAGE.check()
    for name in (name for tests in PROMISES.values() for name in tests):
        file, _, test = name.partition("[")[0].partition("::")
        text = (TOP / "tests" / file).read_text("utf-8")
        assert re.search(rf"^def {test}", text, re.MULTILINE), name

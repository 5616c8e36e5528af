"""Each mutant can be made, and each promise that needs servers has one."""

from __future__ import annotations

import pytest

from tests.mutants.__main__ import all_mutants
from tests.mutants.mutant import Mutant
from tests.mutants.slots import ROOT
from tests.unit.test_promises import functions, listed

WITHOUT = {
    "C9.2": "what type checkers say",
    "C9.3": "what colcon and pip do",
    "C9.5": "what compilers make",
    "C9.6": "what type checkers say",
    "C13.1": "the other promises, on other servers",
    "C13.3": "the other promises, on other servers",
}
"""Promises that are about something else than what servers get and answer."""


@pytest.mark.parametrize("mutant", all_mutants(), ids=lambda m: f"{m.promise}: {m.wrong}")
@pytest.mark.every
def test_it_can_be_made_and_its_tests_are_there(mutant: Mutant) -> None:
    assert mutant.problem(ROOT) is None
    assert mutant.promise in listed()
    for test in mutant.tests:
        file, _, name = test.partition("::")
        assert (ROOT / "tests" / file).is_file(), test
        assert not name or name.partition("[")[0] in functions(ROOT / "tests" / file), test


def test_each_promise_has_one() -> None:
    promises = {number for number in listed() if number.startswith("C") and "." in number}
    assert promises - {mutant.promise for mutant in all_mutants()} == set(WITHOUT)

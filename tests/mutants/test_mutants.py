"""Each mutant can be made, and each promise that needs servers has one."""

from __future__ import annotations

from tests.mutants.__main__ import all_mutants
from tests.mutants.mutant import Mutant
from tests.mutants.promises import walked
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


def test_each_can_be_made_and_its_tests_are_there() -> None:
    problems = [problem for mutant in all_mutants() if (problem := problem_of(mutant))]
    assert not problems, "\n".join(problems)


def problem_of(mutant: Mutant) -> str | None:
    """Say what is wrong with it: most often the code has changed, and it has to follow."""
    if mutant.promise not in listed():
        return f"{mutant.wrong}: there is no promise {mutant.promise}"
    for test in mutant.tests:
        file, _, name = test.partition("::")
        path = ROOT / "tests" / file
        if not path.is_file() or (name and name.partition("[")[0] not in functions(path)):
            return f"{mutant.wrong}: there is no test {test}"
    if mutant.long is not (mutant in walked.MUTANTS):
        return f"{mutant.wrong}: docs/promises.md says that only those in walked.py are long"
    return mutant.problem(ROOT)


def test_no_two_are_the_same() -> None:
    made: dict[tuple[str, str], str] = {}
    for mutant in all_mutants():
        source = mutant.file(ROOT).read_text("utf-8").replace(mutant.old, mutant.new)
        if not mutant.long:  # the walk has some that other tests notice, too
            assert (mutant.path, source) not in made, (mutant.wrong, made[mutant.path, source])
            made[mutant.path, source] = mutant.wrong


def test_each_promise_has_one() -> None:
    promises = {number for number in listed() if number.startswith("C") and "." in number}
    assert promises - {mutant.promise for mutant in all_mutants()} == set(WITHOUT)

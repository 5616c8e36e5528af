"""The limit on retries that callers share (contract C4.5)."""

from __future__ import annotations

import math
import re
import threading

import pytest
from hypothesis import given
from hypothesis import strategies as st

from actionkit import RetryBudget
from actionkit._calls.retries.budget import check_budget


def test_a_new_budget_is_full_and_allows_retries() -> None:
    budget = RetryBudget()
    assert (budget.capacity, budget.tokens, budget.allows_retry) == (10.0, 10.0, True)


def test_failures_take_tokens_and_half_of_them_is_the_limit() -> None:
    budget = RetryBudget(capacity=4.0)
    said = []
    for _ in range(6):
        budget.on_transient_failure()
        said.append((budget.tokens, budget.allows_retry))
    assert said == [(3, True), (2, False), (1, False), (0, False), (0, False), (0, False)]


def test_successes_give_tokens_back_up_to_the_capacity() -> None:
    budget = RetryBudget(capacity=2.0, ratio=0.5)
    budget.on_success()
    assert budget.tokens == 2.0
    budget.on_transient_failure()
    assert not budget.allows_retry
    budget.on_success()
    assert (budget.tokens, budget.allows_retry) == (1.5, True)
    for _ in range(5):
        budget.on_success()
    assert budget.tokens == 2.0


def test_a_server_that_fails_for_everybody_is_soon_left_alone_and_tried_again_later() -> None:
    budget = RetryBudget()
    retries = 0
    for _ in range(1000):
        budget.on_transient_failure()
        retries += budget.allows_retry
    assert retries == 4
    successes = 0
    while not budget.allows_retry:
        budget.on_success()
        successes += 1
    assert successes in (50, 51)  # a tenth of a token each; tenths are not exact


@given(st.floats(0.01, 1e6), st.floats(0.01, 1e6), st.lists(st.booleans(), max_size=100))
def test_tokens_stay_within_their_bounds(capacity: float, ratio: float, fine: list[bool]) -> None:
    budget = RetryBudget(capacity, ratio)
    for each in fine:
        before = budget.tokens
        if each:
            budget.on_success()
            assert budget.tokens >= before
        else:
            budget.on_transient_failure()
            assert budget.tokens <= before
        assert 0 <= budget.tokens <= capacity
        assert budget.allows_retry == (budget.tokens > capacity / 2)


def test_threads_share_it_without_losing_a_token() -> None:
    budget = RetryBudget(capacity=100_000, ratio=0.5)
    start = threading.Barrier(8)

    def work() -> None:
        start.wait()
        for _ in range(1000):
            budget.on_transient_failure()
            budget.on_transient_failure()
            budget.on_success()

    threads = [threading.Thread(target=work) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert budget.tokens == 100_000 - 8 * 1500


@pytest.mark.parametrize("name", ["capacity", "ratio"])
@pytest.mark.parametrize("value", ["1", None, True, [1], 1j], ids=lambda v: type(v).__name__)
def test_what_is_no_number(name: str, value: object) -> None:
    told = f"RetryBudget.{name}={value!r} must be a number"
    with pytest.raises(TypeError, match=f"^{re.escape(told)}$"):
        RetryBudget(**{name: value})  # type: ignore[arg-type]


@pytest.mark.parametrize("name", ["capacity", "ratio"])
@pytest.mark.parametrize(
    ("value", "must_be"),
    [
        (0, "0 must be above 0 and finite"),
        (-1, "-1 must be above 0 and finite"),
        (math.nan, "nan must be above 0 and finite"),
        (math.inf, "inf must be above 0 and finite"),
        (-math.inf, "-inf must be above 0 and finite"),
        (1e9 + 1, r"1000000001\.0 must be 1e9 or less"),
        (10**400, "1000.* must be 1e9 or less"),
    ],
    ids=["0", "-1", "nan", "inf", "-inf", "1e9 + 1", "10**400"],
)
def test_what_is_out_of_range(name: str, value: float, must_be: str) -> None:
    with pytest.raises(ValueError, match=rf"^RetryBudget\.{name}={must_be}"):
        RetryBudget(**{name: value})


def test_what_is_just_within_the_range() -> None:
    budget = RetryBudget(1e9, ratio=1e9)
    assert (budget.capacity, budget.allows_retry) == (1e9, True)


def test_a_client_takes_a_budget_and_nothing_derived_from_one() -> None:
    class Mine(RetryBudget):  # type: ignore[misc]  # it is final
        pass

    check_budget(RetryBudget())
    for wrong in (5, 0, "5", RetryBudget, object()):
        with pytest.raises(TypeError, match=r"^retry_budget=.* must be a RetryBudget: "):
            check_budget(wrong)
    with pytest.raises(TypeError, match=r"Mine, but must be a RetryBudget itself"):
        check_budget(Mine())


def test_its_state_is_readable_and_only_that() -> None:
    budget = RetryBudget(capacity=3, ratio=1)
    assert repr(budget) == "<RetryBudget 3 of 3 tokens, allows retries>"
    budget.on_transient_failure()
    budget.on_transient_failure()
    assert repr(budget) == "<RetryBudget 1 of 3 tokens, forbids retries>"
    for name in ("tokens", "capacity", "allows_retry"):
        with pytest.raises(AttributeError):
            setattr(budget, name, 1)


def test_each_client_has_its_own_unless_they_share() -> None:
    mine, theirs = RetryBudget(), RetryBudget()
    mine.on_transient_failure()
    assert theirs.tokens == theirs.capacity

"""Settings are checked when they are made, and the error names the field and the value."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import pytest
import tenacity

from actionkit import RetryBudget, RetryPolicy, Timeouts
from actionkit._model.settings import MOST, check_seconds

TIMEOUTS = [field.name for field in dataclasses.fields(Timeouts)]
NO_SECONDS = ["1", True, b"", [1], object(), 1j]
BAD_SECONDS = [-1, -0.001, math.nan, -math.inf, math.inf]


def expect(error: type[Exception], cls: type, field: str, value: Any) -> str:
    with pytest.raises(error) as caught:
        cls(**{field: value})
    assert type(caught.value) is error
    text = str(caught.value)
    assert text.startswith(f"{cls.__name__}.{field}={value!r} must be ")
    return text


def test_the_defaults_are_those_of_the_contract() -> None:
    assert Timeouts() == Timeouts(
        server=5.0,
        accept=5.0,
        total=None,
        feedback=None,
        cancel=2.0,
        liveness=None,
        result=30.0,
    )
    assert RetryPolicy() == RetryPolicy(
        attempts=3,
        initial=0.2,
        factor=2.0,
        max_pause=5.0,
        jitter=0.2,
        resend="confirmed_stopped",
        stop=None,
        wait=None,
    )


@pytest.mark.parametrize("cls", [Timeouts, RetryPolicy])
def test_settings_are_values(cls: type) -> None:
    with pytest.raises(dataclasses.FrozenInstanceError):
        setattr(cls(), dataclasses.fields(cls)[0].name, 1)
    assert hash(cls()) == hash(cls())


@pytest.mark.parametrize("field", TIMEOUTS)
@pytest.mark.parametrize("value", NO_SECONDS, ids=lambda value: type(value).__name__)
def test_a_timeout_that_is_no_number(field: str, value: object) -> None:
    text = expect(TypeError, Timeouts, field, value)
    assert ("None" in text) == (field != "cancel")


@pytest.mark.parametrize("field", TIMEOUTS)
@pytest.mark.parametrize("value", BAD_SECONDS)
def test_a_timeout_out_of_range(field: str, value: float) -> None:
    expect(ValueError, Timeouts, field, value)


@pytest.mark.parametrize("field", TIMEOUTS)
@pytest.mark.parametrize("value", [1.1e9, 10**10, 1e300, 10**400])
def test_a_timeout_longer_than_anybody_waits(field: str, value: float) -> None:
    with pytest.raises(ValueError, match=rf"^Timeouts\.{field}=.* must be 1e9 or less"):
        Timeouts(**{field: value})


@pytest.mark.parametrize("field", TIMEOUTS)
def test_timeouts_are_float_seconds(field: str) -> None:
    for value in (1, 3, 0.5, 1e9) if field == "liveness" else (0, 3, 0.5, 1e9):
        seconds = getattr(Timeouts(**{field: value}), field)
        assert (seconds, type(seconds)) == (value, float)


def test_a_server_is_asked_from_time_to_time_or_not_at_all() -> None:
    with pytest.raises(ValueError, match="liveness") as caught:
        Timeouts(liveness=0)
    assert str(caught.value) == "Timeouts.liveness=0 must be above 0; None means not to ask"


def test_no_limit_is_none_but_for_the_wait_for_a_cancellation() -> None:
    assert Timeouts(server=None, accept=None, total=None, feedback=None).server is None
    assert "None" not in expect(TypeError, Timeouts, "cancel", None).split("must be")[1]


HUGE = {"1e300": 1e300, "more than a float holds": 10**400, "too long to print": 10**5000}


@pytest.mark.parametrize("value", HUGE.values(), ids=HUGE)
def test_a_number_too_large_for_any_clock(value: float) -> None:
    wanted = [(Timeouts, field) for field in TIMEOUTS]
    wanted += [(RetryPolicy, field) for field in ("initial", "factor", "max_pause", "jitter")]
    wanted += [(RetryBudget, field) for field in ("capacity", "ratio")]
    for cls, field in wanted:
        with pytest.raises(ValueError, match=rf"^{cls.__name__}\.{field}=.* must be 1e9 or less"):
            cls(**{field: value})
    with pytest.raises(ValueError, match=r"^timeout=.* must be 1e9 or less; None means no limit$"):
        check_seconds("timeout", value)


def test_the_largest_number_is_allowed() -> None:
    assert check_seconds("timeout", MOST) == MOST
    assert RetryBudget(capacity=MOST).capacity == MOST


def test_a_long_value_is_shortened_in_the_error() -> None:
    for value in (10**400, -(10**400), 10**5000, "x" * 10**6, [1.5] * 10**6):
        with pytest.raises((TypeError, ValueError)) as caught:
            check_seconds("timeout", value)
        assert len(str(caught.value)) < 200
    with pytest.raises(ValueError, match=r"^RetryPolicy\.attempts=") as caught_too:
        RetryPolicy(attempts=-(10**5000))
    assert len(str(caught_too.value)) < 200


@pytest.mark.parametrize("value", [1.0, "3", None, True])
def test_attempts_that_are_no_whole_number(value: object) -> None:
    expect(TypeError, RetryPolicy, "attempts", value)


@pytest.mark.parametrize("value", [0, -1])
def test_too_few_attempts(value: int) -> None:
    told = expect(ValueError, RetryPolicy, "attempts", value)
    assert told == f"RetryPolicy.attempts={value} must be 1 or more: it includes the first"


@pytest.mark.parametrize("field", ["initial", "factor", "max_pause", "jitter"])
def test_pauses(field: str) -> None:
    for value in [*NO_SECONDS, None]:
        expect(TypeError, RetryPolicy, field, value)
    for number in BAD_SECONDS:
        expect(ValueError, RetryPolicy, field, number)
    # "None means no limit" is for limits.
    told = expect(TypeError, RetryPolicy, field, "1")
    assert told == f"RetryPolicy.{field}='1' must be a number of seconds"
    told = expect(ValueError, RetryPolicy, field, math.inf)
    assert told == f"RetryPolicy.{field}=inf must be finite"
    assert type(getattr(RetryPolicy(**{field: 1}), field)) is float


def test_factor_and_jitter_have_their_ranges() -> None:
    expect(ValueError, RetryPolicy, "factor", 0.9)
    expect(ValueError, RetryPolicy, "jitter", 1.1)
    assert RetryPolicy(factor=1, jitter=0) == RetryPolicy(factor=1.0, jitter=0.0)


@pytest.mark.parametrize("value", ["sometimes", "", None, 1, True])
def test_an_unknown_resend(value: object) -> None:
    text = expect(ValueError, RetryPolicy, "resend", value)
    for known in ("never_accepted", "confirmed_stopped", "always"):
        assert known in text
        RetryPolicy(resend=known)  # type: ignore[arg-type]


@pytest.mark.parametrize("field", ["stop", "wait"])
def test_strategies_are_tenacitys(field: str) -> None:
    expect(TypeError, RetryPolicy, field, 3)
    strategy = {"stop": tenacity.stop_after_attempt(2), "wait": tenacity.wait_fixed(1)}[field]
    assert getattr(RetryPolicy(**{field: strategy}), field) is strategy  # type: ignore[arg-type]


async def coroutine(_: object) -> Any: ...


class Asynchronous:
    async def __call__(self, _: object) -> Any: ...


@pytest.mark.parametrize("field", ["stop", "wait"])
@pytest.mark.parametrize(
    ("value", "told"),
    [
        (tenacity.stop_after_attempt, "this is a class: make an instance"),
        (coroutine, "this is a coroutine function"),
        (Asynchronous(), "this is a coroutine function"),
        (1.5, "strategy of tenacity's"),
    ],
)
def test_strategies_that_could_never_answer(field: str, value: Any, told: str) -> None:
    assert told in expect(TypeError, RetryPolicy, field, value)


def test_a_policy_that_never_tries_again() -> None:
    assert RetryPolicy.none().attempts == 1


def test_one_time_of_a_call_is_checked_alike() -> None:
    assert check_seconds("timeout", None) is None
    assert check_seconds("timeout", 1) == 1.0
    with pytest.raises(TypeError, match=r"^timeout='1' must be a number of seconds or None"):
        check_seconds("timeout", "1")
    with pytest.raises(ValueError, match=r"^timeout=nan must be zero or more"):
        check_seconds("timeout", math.nan)
    with pytest.raises(ValueError, match=r"^timeout=inf must be finite; None means no limit"):
        check_seconds("timeout", math.inf)

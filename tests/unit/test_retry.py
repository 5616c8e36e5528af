"""Whether, when and how a call is tried again: the decisions, as tables (contract C4)."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from typing import Any, get_args, get_type_hints

import numpy
import pytest
import tenacity
from hypothesis import given
from hypothesis import strategies as st

from actionkit import GoalState, RetryBudget, RetryPolicy, ServerLostError
from actionkit._calls.retries.retry import (
    GiveUp,
    Retry,
    Schedule,
    after_no_server,
    may_try_again,
    plan,
)
from actionkit._calls.retries.retry_runner import RetryRunner
from actionkit._goal.effects import End, Ending, Fault, LastNews
from actionkit._threads.clock import TimerHandle

# --- resend safety (contract C4.2) -------------------------------------------------------------

NO, NEW = False, True
POLICIES = ("never_accepted", "confirmed_stopped", "server_gone", "always")
TABLE: dict[LastNews, tuple[bool, ...]] = {
    # What became of the earlier goal: what each policy, in the order above, makes of it.
    LastNews.NOTHING: (NO, NO, NO, NEW),
    LastNews.UNKNOWN_TO_SERVER: (NO, NO, NO, NEW),
    LastNews.SERVER_GONE: (NO, NO, NEW, NEW),
    LastNews.STOPPED: (NO, NEW, NEW, NEW),
}


def test_the_table_is_total() -> None:
    assert set(TABLE) == set(LastNews)
    assert get_args(get_type_hints(RetryPolicy)["resend"]) == POLICIES


@pytest.mark.parametrize("news", LastNews)
@pytest.mark.parametrize("resend", POLICIES)
def test_whether_a_goal_is_sent_again(news: LastNews, resend: str) -> None:
    assert may_try_again(False, news, resend) is TABLE[news][POLICIES.index(resend)]
    assert may_try_again(True, news, resend)  # it was rejected


MAY_RUN = "the goal may still run, or have run (resend="
HINT = "; resend='server_gone' tries again when its server has left the graph"


@pytest.mark.parametrize(
    ("news", "resend", "reason"),
    [
        (LastNews.SERVER_GONE, "confirmed_stopped", f"{MAY_RUN}'confirmed_stopped'{HINT})"),
        (LastNews.NOTHING, "confirmed_stopped", f"{MAY_RUN}'confirmed_stopped')"),
        (LastNews.SERVER_GONE, "never_accepted", f"{MAY_RUN}'never_accepted')"),
        (LastNews.STOPPED, "never_accepted", f"{MAY_RUN}'never_accepted')"),
        (LastNews.SERVER_GONE, "server_gone", None),
        (LastNews.STOPPED, "confirmed_stopped", None),
    ],
)
def test_the_reason_says_that_the_goal_may_run(
    news: LastNews, resend: str, reason: str | None
) -> None:
    ending = Ending(End.LOST, GoalState.LOST, news=news)
    said = plan(1.5, ending, resend, RetryBudget(), too_late=False)
    assert said == (Retry(1.5) if reason is None else GiveUp(reason))
    rejected = replace(ending, rejected=True)
    assert plan(1.5, rejected, resend, RetryBudget(), too_late=False) == Retry(1.5)


# --- a server that does not come back (contract C2.7) ------------------------------------------

NO_SERVER = Ending(End.NO_SERVER, GoalState.TIMED_OUT, given_up=True)
LOST = Ending(End.LOST, GoalState.LOST, news=LastNews.SERVER_GONE)
TIME_IS_UP = replace(NO_SERVER, end=End.DEADLINE, phase="server")


@pytest.mark.parametrize(
    ("last", "late", "ready", "in_flight", "then"),
    [
        # It never had a server: it ends, with the deadline's error only where one was ready.
        (None, False, False, False, NO_SERVER),
        (None, True, False, False, NO_SERVER),
        (None, True, True, False, TIME_IS_UP),
        # It had one: the deadline ends it, and before that the attempt before this one decides.
        (LOST, True, False, True, TIME_IS_UP),
        (LOST, True, True, True, TIME_IS_UP),
        (LOST, False, False, True, "no server was ready within 2.5 s"),
        (
            replace(LOST, news=LastNews.STOPPED),
            False,
            False,
            False,
            "no server was ready within 2.5 s",
        ),
        (
            replace(LOST, news=LastNews.NOTHING),
            False,
            True,
            True,
            "the server of an earlier goal is still there, so it may be alive",
        ),
        (
            replace(LOST, news=LastNews.STOPPED),
            False,
            True,
            False,
            "a server is there, but the result of an earlier goal has not come",
        ),
    ],
)
def test_how_a_call_continues_that_found_no_server(
    last: Ending | None, late: bool, ready: bool, in_flight: bool, then: Ending | str
) -> None:
    # Of an attempt that was lost: whether its goal may run is asked again now.
    before = last and replace(last, news=LastNews.SERVER_GONE)
    if isinstance(then, str):
        assert last is not None
        then = replace(last, not_retried=then)
    assert after_no_server(NO_SERVER, before, 2.5, late, ready, in_flight) == then


# --- pauses and limits (contract C4.1) ---------------------------------------------------------

ERROR = ServerLostError("gone")


def pauses(policy: RetryPolicy, attempts: int) -> list[Any]:
    """Return what the schedule says after each attempt; attempts take no time, pauses do."""
    schedule, now, said = Schedule(policy, 0.0), 0.0, []
    for number in range(1, attempts + 1):
        said.append(schedule.next_pause(ERROR, number, now))
        if isinstance(said[-1], float):
            now += said[-1]
    return said


class Inline:
    """A communication thread and a pool that run everything at once."""

    def submit(self, job: Callable[[], None], label: object) -> str:
        job()
        return ""

    def call_soon(self, callback: Callable[[], None]) -> None:
        callback()

    def call_at(self, at: float, callback: Callable[[], None]) -> TimerHandle:
        return TimerHandle(at, callback)

    def cancel_timer(self, handle: TimerHandle) -> None: ...


def plan_of(policy: RetryPolicy, attempts: int, now: float, deadline: float | None) -> Any:
    """Return what is decided after a goal that was never sent."""
    plans: list[Any] = []
    inline: Any = Inline()
    runner = RetryRunner(inline, inline, policy, RetryBudget(), 0.0)
    ending = Ending(End.NO_SERVER, GoalState.SENDING)
    runner.begin(ending, ERROR, attempts, lambda: now, deadline, plans.append)
    return plans[0]


def test_each_pause_is_longer_up_to_the_longest() -> None:
    policy = RetryPolicy(attempts=7, initial=0.5, factor=3.0, max_pause=10.0, jitter=0.0)
    said = pauses(policy, 7)
    assert said[:6] == [0.5, 1.5, 4.5, 10.0, 10.0, 10.0]
    assert isinstance(said[6], GiveUp)


def test_the_pauses_of_the_default_policy() -> None:
    for _ in range(50):
        first, second, end = pauses(RetryPolicy(), 3)
        assert 0.16 <= first <= 0.24
        assert 0.32 <= second <= 0.48
        assert isinstance(end, GiveUp)


@given(
    st.floats(0, 100),
    st.floats(1, 10),
    st.floats(0, 100),
    st.floats(0, 1),
    st.integers(1, 2000),
)
def test_a_pause_keeps_to_its_share_of_chance_and_to_the_longest(
    initial: float, factor: float, most: float, jitter: float, attempt: int
) -> None:
    policy = RetryPolicy(5000, initial, factor, most, jitter)
    said = Schedule(policy, 0.0).next_pause(ERROR, attempt, 0.0)
    try:
        plain = min(initial * factor ** (attempt - 1), most)
    except OverflowError:
        plain = most if initial else 0.0
    assert isinstance(said, float)
    assert plain * (1 - jitter) - 1e-9 <= said <= plain * (1 + jitter) + 1e-9
    assert said <= most + 1e-9  # "the longest pause, in seconds"


def test_chance_makes_pauses_differ() -> None:
    policy = RetryPolicy(initial=1.0, jitter=0.5)
    seconds = {Schedule(policy, 0.0).next_pause(ERROR, 1, 0.0) for _ in range(50)}
    assert len(seconds) > 10
    assert min(seconds) < 0.9
    assert max(seconds) > 1.1


@pytest.mark.parametrize("attempts", [1, 2, 5])
def test_attempts_include_the_first(attempts: int) -> None:
    said = pauses(RetryPolicy(attempts=attempts), attempts)
    assert [type(each) for each in said] == [float] * (attempts - 1) + [GiveUp]


def test_a_policy_of_one_attempt_never_pauses() -> None:
    assert pauses(RetryPolicy.none(), 1) == [GiveUp("the retry policy allows one attempt")]
    two = pauses(RetryPolicy(attempts=2), 2)
    assert two[1] == GiveUp("all 2 attempts of the retry policy are used up")


@pytest.mark.parametrize(
    "policy", [RetryPolicy(initial=2.0, jitter=0.0), RetryPolicy(wait=tenacity.wait_fixed(2.0))]
)
@pytest.mark.parametrize(
    ("deadline", "begun"), [(None, True), (12.5, True), (12.0, False), (11.0, False), (10.0, False)]
)
def test_a_pause_that_would_cross_the_deadline_is_not_begun(
    policy: RetryPolicy, deadline: float | None, begun: bool
) -> None:
    said = plan_of(policy, 1, 10.0, deadline)
    assert isinstance(said, Retry if begun else GiveUp)
    if isinstance(said, GiveUp):
        assert "2 s" in said.reason
        assert "deadline" in said.reason


# --- strategies of tenacity's ------------------------------------------------------------------


def test_a_stop_strategy_stands_in_place_of_attempts() -> None:
    policy = RetryPolicy(attempts=2, stop=tenacity.stop_after_attempt(4), jitter=0.0)
    assert [type(each) for each in pauses(policy, 4)] == [float, float, float, GiveUp]
    never = RetryPolicy(attempts=1, stop=tenacity.stop_never)
    assert {type(each) for each in pauses(never, 30)} == {float}


def test_a_stop_strategy_sees_the_time_since_the_call_began() -> None:
    policy = RetryPolicy(stop=tenacity.stop_after_delay(10.0))
    schedule = Schedule(policy, 100.0)
    assert isinstance(schedule.next_pause(ERROR, 1, 109.9), float)
    assert isinstance(schedule.next_pause(ERROR, 2, 110.0), GiveUp)


def test_a_wait_strategy_stands_in_place_of_the_pauses_and_of_chance() -> None:
    policy = RetryPolicy(attempts=5, jitter=1.0, wait=tenacity.wait_fixed(1.25))
    assert pauses(policy, 4) == 4 * [1.25]
    policy = RetryPolicy(attempts=9, wait=tenacity.wait_chain(*map(tenacity.wait_fixed, (1, 2))))
    assert pauses(policy, 4) == [1.0, 2.0, 2.0, 2.0]


def test_strategies_see_the_error_and_the_pauses_so_far() -> None:
    seen: list[tuple[Any, ...]] = []

    def stop(state: tenacity.RetryCallState) -> bool:
        assert state.outcome is not None
        error = state.outcome.exception()
        seen.append((error, state.attempt_number, state.idle_for, state.seconds_since_start))
        # As in tenacity's own loop, though there is no function to call.
        assert isinstance(state.retry_object, tenacity.Retrying)
        assert (state.fn, state.args, state.kwargs) == (None, (), {})
        return False

    schedule = Schedule(RetryPolicy(stop=stop, wait=tenacity.wait_fixed(2.0)), 5.0)
    other = ServerLostError("again")
    schedule.next_pause(ERROR, 1, 6.0)
    schedule.next_pause(other, 2, 9.0)
    assert schedule.next_pause(other, 3, 12.0) == 2.0
    assert seen == [(ERROR, 1, 0.0, 1.0), (other, 2, 2.0, 4.0), (other, 3, 4.0, 7.0)]


def test_strategies_may_be_combined() -> None:
    stop = tenacity.stop_after_attempt(3) | tenacity.stop_after_delay(1.0)
    wait = tenacity.wait_fixed(0.25) + tenacity.wait_fixed(0.5)
    policy = RetryPolicy(stop=stop, wait=wait)
    assert pauses(policy, 3)[:2] == [0.75, 0.75]
    assert isinstance(pauses(policy, 3)[2], GiveUp)


# --- strategies that do not do what they should ------------------------------------------------


@pytest.mark.parametrize("value", [None, "yes", 0, 1.0, [], 1j], ids=repr)
def test_a_stop_strategy_that_returns_no_bool(value: Any) -> None:
    said = pauses(RetryPolicy(stop=lambda _: value), 1)[0]
    assert isinstance(said, Fault)
    assert said.problem.startswith("`RetryPolicy.stop=")
    assert repr(value) in said.problem
    assert "neither True nor False" in said.problem


WRONG = [None, "1", True, -0.001, math.nan, math.inf, -math.inf, 10**400, 1e300, 1j, [1.0]]


@pytest.mark.parametrize("value", WRONG, ids=lambda value: repr(value)[:20])
def test_a_wait_strategy_that_returns_no_time(value: Any) -> None:
    said = pauses(RetryPolicy(wait=lambda _: value), 1)[0]
    assert isinstance(said, Fault)
    assert said.problem.startswith("`RetryPolicy.wait=")
    assert f" returned {repr(value)[:20]}" in said.problem
    assert "no number of seconds from 0 to 1e+09" in said.problem
    assert len(said.problem) < 500


@pytest.mark.parametrize(
    "value", [0, 2, 0.5, Fraction(1, 4), numpy.float32(1.5), numpy.int64(3), 1e9]
)
def test_a_wait_strategy_may_return_any_kind_of_number(value: Any) -> None:
    said = pauses(RetryPolicy(wait=lambda _: value), 1)[0]
    assert said == float(value)
    assert type(said) is float


@pytest.mark.parametrize("error", [ValueError("no"), KeyboardInterrupt(), SystemExit(1)])
@pytest.mark.parametrize("name", ["stop", "wait"])
def test_a_strategy_that_raises(name: str, error: BaseException) -> None:
    def strategy(_: object) -> Any:
        raise error

    said = pauses(RetryPolicy(**{name: strategy}), 1)[0]  # type: ignore[arg-type]
    assert isinstance(said, Fault)
    assert said.cause is error
    assert f"`RetryPolicy.{name}=" in said.problem
    assert f"strategy` raised {type(error).__name__}" in said.problem


class Hostile:
    """A strategy that says that it is nothing, and has no good answers to anything else."""

    def __call__(self, _: object) -> Any:
        raise ValueError("asked")

    def __bool__(self) -> bool:
        return False

    def __repr__(self) -> str:
        raise AssertionError("this runs code of the user's on the communication thread")


@pytest.mark.parametrize("name", ["stop", "wait"])
def test_a_strategy_is_asked_whatever_it_says_of_itself(name: str) -> None:
    said = pauses(RetryPolicy(**{name: Hostile()}), 1)[0]  # type: ignore[arg-type]
    assert isinstance(said, Fault)
    assert said.problem == f"`RetryPolicy.{name}=Hostile` raised ValueError: asked"


@pytest.mark.parametrize("names", [("stop",), ("wait",), ("stop", "wait")])
def test_a_strategy_that_was_never_begun_is_named(names: tuple[str, ...]) -> None:
    policy = RetryPolicy(**dict.fromkeys(names, Hostile()))  # type: ignore[arg-type]
    assert Schedule(policy, 0.0).strategy == f"`RetryPolicy.{names[0]}=Hostile`"


# --- words -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("policy", "attempt", "deadline", "words"),
    [
        (RetryPolicy(), 3, None, ("3 attempts",)),
        (RetryPolicy(), 1, 0.1, ("pause", "s would have crossed the deadline")),
        (RetryPolicy(stop=tenacity.stop_after_attempt(2)), 2, None, ("stop", "2 attempts")),
    ],
    ids=["attempts", "deadline", "stop"],
)
def test_the_reason_names_the_limit_that_ended_the_retries(
    policy: RetryPolicy, attempt: int, deadline: float | None, words: tuple[str, ...]
) -> None:
    said = plan_of(policy, attempt, 0.0, deadline)
    assert isinstance(said, GiveUp)
    for word in words:
        assert word in said.reason
    assert not said.reason.endswith(".")  # it stands inside a sentence


def test_the_reason_names_the_budget() -> None:
    empty = RetryBudget(capacity=1.0)
    empty.on_transient_failure()
    ending = Ending(End.NO_SERVER, GoalState.SENDING)
    said = plan(1.0, ending, "confirmed_stopped", empty, too_late=False)
    assert said == GiveUp(
        "the retry budget forbids it (<RetryBudget 0 of 1 tokens, forbids retries>)"
    )

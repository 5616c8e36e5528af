"""A call under every order of events: what its goals' servers may be doing, and what it ends with.

What must hold is in call_life, and is checked after each event.
"""

from __future__ import annotations

import concurrent.futures
import re
from types import SimpleNamespace
from typing import Any
from unittest import mock

import pytest
from call_life import CallLife
from hunting import examples
from hypothesis import given
from hypothesis import strategies as st

from actionkit import CancelReport, GoalState, RetryBudget, RetryPolicy, Verdict
from actionkit._calls.ending.closing import end_interrupted
from actionkit._model import errors
from actionkit._model.cancel_answer import CancelAnswer

Event = tuple[Any, ...]

which = st.sampled_from([0, 0, 0, 1, 1, 2])
"""The goal that is spoken of, from the last one sent."""
ends = [GoalState.SUCCEEDED, GoalState.CANCELED, GoalState.ABORTED]
states = [GoalState.ACCEPTED, GoalState.EXECUTING, GoalState.CANCELING, *ends]
seconds = st.sampled_from([0.1, 0.2, 0.5, 1.0, 3.0, 5.0, 10.0])


def event(name: str, *arguments: Any) -> st.SearchStrategy[Event]:
    return st.tuples(st.just(name), *arguments)


servers = [
    *(event("ready"), event("settling"), event("gone"), event("back"), event("restarted")),
    *(event("twice"), event("first_leaves")),
]
answers = [
    event("accepted", which),
    event("rejected", which),
    event("feedback", which),
    event("status", which, st.sampled_from(states)),
    event("result", which, st.sampled_from([*ends, None, None])),
    event("cancel_answer", which, st.sampled_from(CancelAnswer)),
    event("cancel_answer", which, st.just(CancelAnswer.UNKNOWN_GOAL)),
]
time = [event("wait", seconds), event("fire"), event("fire")]
user = [event("cancel"), event("close", st.booleans())]
verdicts = st.sampled_from([*Verdict, *Verdict, None, "raises", "nonsense"])
strategies = st.sampled_from([*5 * ["fine"], "stop raises", "wait raises", "nonsense"])
rest = [event("judge", verdicts, strategies), event("busy", st.booleans()), event("fail")]
everything = st.one_of(*servers, *answers, *time, *time, *user, *rest)
peaceful = st.one_of(*servers, *answers, *time, *time, *rest[:2])
limit = st.sampled_from([None, 1.0, 5.0])
policies = st.builds(
    RetryPolicy,
    attempts=st.integers(1, 4),
    jitter=st.just(0.0),
    resend=st.sampled_from(["confirmed_stopped", "server_gone"] * 2 + ["never_accepted", "always"]),
)
lives = st.builds(
    CallLife,
    timeout=st.sampled_from([None, None, 4.0, 30.0]),
    retry=policies,
    judged=st.booleans(),
    strategies=st.sampled_from([False, False, True]),
    server=limit,
    accept=limit,
    feedback=limit,
)

SENT: list[Event] = [("ready",)]


@examples(1500)
@given(lives, st.sampled_from([SENT, SENT, []]), st.lists(everything, max_size=40))
def test_every_order(life: CallLife, begun: list[Event], events: list[Event]) -> None:
    for each in [*begun, *events]:
        life.happens(*each)
    if life.deadline is not None:
        life.happens("wait", 100.0)  # whether the user's functions answer or not
        assert life.done


@examples(1000)
@given(lives, st.lists(peaceful, max_size=30))
def test_whatever_happened_a_server_that_answers_brings_it_to_an_end(
    life: CallLife, events: list[Event]
) -> None:
    life.happens("ready")
    for each in events:
        life.happens(*each)
    life.told.append(("come_to_good",))
    life.come_to_good(300.0)
    life.require(life.done, "it does not hang")


@examples(500)
@given(lives, st.lists(everything, max_size=30))
def test_no_goal_is_ever_lost_track_of(life: CallLife, events: list[Event]) -> None:
    """Whatever its caller made of it, a goal that may run is asked about, for ever."""
    life.happens("ready")
    for each in events:
        life.happens(*each)
    if life.broke or life.abandon:
        return
    life.happens("ready")  # it asks of itself about what is lost
    life.happens("wait", 0.1)
    seen = life.is_in_sight
    before = {key: goal.asked for key, goal in life.goals.items() if goal.may_run and seen(goal)}
    life.happens("wait", 31.0)
    for key, asked in before.items():
        waits = key in life.link.queue  # for its turn to be sent again
        goal = life.goals[key]
        life.require(waits or goal.asked > asked, "a goal that may run is asked about")


# --- orders that are easily got wrong ----------------------------------------------------------

UNKNOWN, ACCEPTED = CancelAnswer.UNKNOWN_GOAL, CancelAnswer.ACCEPTED
TERMINATED = CancelAnswer.TERMINATED
RUNNING: list[Event] = [*SENT, ("accepted", 0)]
PAUSE: list[Event] = [("wait", 0.5)]
UNANSWERED: list[Event] = [*SENT, ("wait", 5.0), ("cancel_answer", 0, UNKNOWN)]
"""The server did not say in time whether it takes the goal, and does not know it."""
UNKNOWN_YET: list[Event] = [*SENT, ("wait", 1.0), ("result", 0, None), ("wait", 2.0)]
"""Its server has said that it does not know the goal."""
LOST: list[Event] = [*RUNNING, ("gone",)]
STALLED: list[Event] = [*RUNNING, ("wait", 1.0)]
CANCELING: list[Event] = [*RUNNING, ("status", 0, GoalState.CANCELING)]
BACK: list[Event] = [*PAUSE, ("back",)]
NO_LIMITS = {"server": None, "accept": None}

SUBTLE: dict[str, tuple[dict[str, Any], list[Event], int]] = {
    # The limits, what happens, and how many requests are sent in the end.
    "a lost goal that lives on keeps the next one back": (
        NO_LIMITS,
        [*LOST, ("ready",), ("feedback", 0), *PAUSE, ("ready",)],
        1,
    ),
    "a lost goal whose server is back keeps all later attempts back": (
        {"server": 1.0},
        [*LOST, *PAUSE, ("wait", 1.0), ("wait", 1.0), ("back",)],
        1,
    ),
    "a lost goal that no server knows makes room for the next": (
        NO_LIMITS,
        [*LOST, *PAUSE, ("ready",), ("cancel_answer", 0, UNKNOWN)],
        2,
    ),
    "what somebody else cancelled is not retried, also if that shows that it was accepted": (
        {"accept": 1.0, "retry": RetryPolicy(jitter=0.0, initial=2.0, resend="always")},
        [
            ("ready",),
            ("wait", 1.0),
            ("cancel_answer", 0, UNKNOWN),
            ("wait", 0.6),
            ("result", 0, GoalState.CANCELED),
            ("wait", 3.0),
        ],
        1,
    ),
    "the same where the status topic shows that end": (
        {"accept": 1.0, "retry": RetryPolicy(jitter=0.0, initial=2.0, resend="always")},
        [
            ("ready",),
            ("wait", 1.0),
            ("cancel_answer", 0, UNKNOWN),
            ("wait", 0.6),
            ("status", 0, GoalState.CANCELED),
            ("result", 0, GoalState.CANCELED),
            ("wait", 3.0),
        ],
        1,
    ),
    "the next goal is sent also where another server came between": (
        NO_LIMITS,
        [*LOST, ("restarted",), *PAUSE, ("settling",), ("result", 0, None), ("ready",)],
        2,
    ),
    "the next goal is sent also where the server went between": (
        NO_LIMITS,
        [*LOST, ("restarted",), *PAUSE, ("gone",), ("result", 0, None), ("ready",)],
        2,
    ),
    "what somebody else cancelled is not retried, also when that is told late": (
        NO_LIMITS,
        [*LOST, *PAUSE, ("result", 0, GoalState.CANCELED), ("ready",)],
        1,
    ),
    "nor where `classify=` says that it may pass": (
        NO_LIMITS | {"judged": True},
        [*RUNNING, ("result", 0, GoalState.CANCELED), ("judge", Verdict.TRANSIENT), *PAUSE],
        1,
    ),
    "nor where the server answered that it knew nothing of what we wanted cancelled": (
        NO_LIMITS | {"feedback": 1.0},
        [*STALLED, ("cancel_answer", 0, UNKNOWN), ("result", 0, GoalState.CANCELED), *PAUSE],
        1,
    ),
    "what our cancel stopped is tried again": (
        NO_LIMITS | {"feedback": 1.0},
        [*STALLED, ("result", 0, GoalState.CANCELED), *PAUSE],
        2,
    ),
    "nor where it had ended, or somebody else had cancelled it, before our cancel came": (
        NO_LIMITS | {"feedback": 1.0},
        [*STALLED, ("cancel_answer", 0, TERMINATED), ("result", 0, GoalState.CANCELED), *PAUSE],
        1,
    ),
    "what somebody else cancels does not stall": (
        NO_LIMITS | {"feedback": 1.0},
        [*CANCELING, ("wait", 5.0), ("result", 0, GoalState.CANCELED), *PAUSE],
        1,
    ),
    "what somebody else cancels is not retried, also where its server is lost": (
        NO_LIMITS,
        [*CANCELING, ("gone",), *PAUSE, ("ready",)],
        1,
    ),
    "nor where that is seen only after its server was lost": (
        NO_LIMITS,
        [*LOST, ("status", 0, GoalState.CANCELING), ("result", 0, GoalState.CANCELED), *BACK],
        1,
    ),
    "nor where its server comes back with that": (
        NO_LIMITS | {"retry": RetryPolicy(jitter=0.0, resend="always")},
        [*LOST, ("status", 0, GoalState.CANCELING), *BACK],
        1,
    ),
    "what waits in vain to be sent again to a server that is there is watched on": (
        {"server": 1.0, "accept": 1.0},
        [
            *SENT,
            ("wait", 1.0),
            ("wait", 0.5),  # it is asked to cancel a second time
            ("settling",),
            ("cancel_answer", 0, UNKNOWN),
            ("wait", 2.0),
            ("cancel_answer", 0, UNKNOWN),
            ("ready",),
        ],
        1,
    ),
    "an earlier goal that proves to have been aborted is not run twice": (
        NO_LIMITS,
        [*LOST, *PAUSE, ("result", 0, GoalState.ABORTED), ("ready",)],
        1,
    ),
    "an earlier goal that proves to have been rejected is not tried again": (
        {},
        [*UNANSWERED, ("rejected", 0), *PAUSE],
        1,
    ),
    "an id is not sent twice, also where its server does not know it": (
        {},
        [*UNKNOWN_YET, ("result", 0, None), ("wait", 4.0), ("result", 0, None), *PAUSE],
        1,
    ),
    "nor is it sent to another incarnation": (
        NO_LIMITS | {"accept": 5.0},
        [*UNKNOWN_YET, ("gone",), ("ready",)],
        1,
    ),
    "what its server may take yet, after an outage, keeps the next goal back": (
        NO_LIMITS,
        [*SENT, ("gone",), *PAUSE, ("back",), ("cancel_answer", 0, UNKNOWN)],
        1,
    ),
    "what its server had, and does not know after an outage, makes room for the next": (
        NO_LIMITS,
        [*LOST, *PAUSE, ("back",), ("cancel_answer", 0, UNKNOWN)],
        2,
    ),
    "close ends a call that waits for what became of an unanswered goal": (
        {},
        [*SENT, ("wait", 5.0), ("close", False), ("cancel_answer", 0, UNKNOWN), *PAUSE],
        1,
    ),
    "close ends a call whose feedback stalled": (
        {"feedback": 1.0},
        [*RUNNING, ("wait", 1.0), ("close", False), ("gone",), *PAUSE, ("ready",)],
        1,
    ),
    "nothing is tried again on a thread that died": ({"server": None}, [("fail",), *PAUSE], 0),
    "nor what the server did not know before": (
        {},
        [*SENT, ("wait", 1.0), ("result", 0, None), ("fail",), *PAUSE],
        1,
    ),
    "a goal that ended is not run again because its result went with the server": (
        {},
        [*RUNNING, ("status", 0, GoalState.SUCCEEDED), ("gone",), *PAUSE, ("ready",)],
        1,
    ),
}


def lived(events: list[Event], **options: Any) -> CallLife:
    """Live through it with a policy that tries again when the server is gone."""
    life = CallLife(**{"retry": RetryPolicy(jitter=0.0, resend="server_gone")} | options)
    for each in events:
        life.happens(*each)
    return life


@pytest.mark.parametrize("back", ["ready", "back", "restarted"])
def test_by_default_nothing_is_sent_after_a_server_was_lost(back: str) -> None:
    """A process that only hangs, or made its server anew, may run the goal (C4.2)."""
    life = lived([*LOST, (back,), *PAUSE, ("cancel_answer", 0, UNKNOWN)], retry=RetryPolicy())
    assert life.sends == 1
    assert "resend='server_gone' tries again" in str(life.outcome.error)
    assert life.outcome.cancel is CancelReport.UNKNOWN


@pytest.mark.parametrize("promise", SUBTLE)
def test_subtle_orders(promise: str) -> None:
    limits, events, sends = SUBTLE[promise]
    assert lived(events, **limits).sends == sends


# --- what it ends with -------------------------------------------------------------------------


def test_attempts_end_with_the_last_error_and_the_limit_that_ended_them() -> None:
    life = lived([*3 * [*LOST, *PAUSE, ("ready",), ("cancel_answer", 0, UNKNOWN)]])
    error = life.outcome.error
    assert isinstance(error, errors.ServerLostError)
    assert (life.sends, life.outcome.attempts, error.attempts) == (3, 3, 3)
    assert "all 3 attempts" in str(error)
    states = [event.state for event in life.outcome.timeline]
    assert states.count(GoalState.RETRYING) == 2
    assert [event.attempt for event in life.outcome.timeline][-1] == 3
    assert len({event.goal_id for event in life.outcome.timeline}) == 3


def test_a_cancel_that_was_repeated_is_ours() -> None:
    """The server did not know the goal when it was asked first."""
    life = CallLife()
    life.ready()
    life.cancel()
    life.cancel_answer(0, CancelAnswer.UNKNOWN_GOAL)
    life.wait(1.0)  # it is asked again
    life.cancel_answer(0, CancelAnswer.ACCEPTED)
    life.result(0, GoalState.CANCELED)
    assert life.done
    assert life.call.future.cancelled()


def test_a_human_who_waits_comes_first_also_if_the_client_was_closed_before() -> None:
    """After `rclpy.init()`, Ctrl-C shuts ROS down before the blocking call hears of it."""
    for closed in (False, True):
        life = CallLife()
        life.ready()
        if closed:
            life.close(abandon=False)
        assert not life.link.urgent
        life.wanted = False
        no_wait: Any = SimpleNamespace(was_interrupted=True)
        life.does(end_interrupted, no_wait, life.call, KeyboardInterrupt())
        assert life.link.urgent
        (goal,) = life.goals.values()
        assert goal.cancels_asked == 1 + closed


def test_a_caller_with_little_time_left_comes_first() -> None:
    """Its error comes in time, and what happened to the goal is to be known by then."""
    life = lived([*RUNNING, ("wait", 4.0)], timeout=4.0)
    assert life.link.urgent
    life = lived([*RUNNING, ("cancel",)])
    assert not life.link.urgent


def test_a_goal_that_the_middleware_does_not_take_is_one_error(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    life, error = CallLife(), ValueError("from rclpy's converters")
    monkeypatch.setattr(life.link, "send_goal", mock.Mock(side_effect=error))
    life.ready()
    assert type(life.outcome.error) is errors.InvalidGoalError
    assert life.outcome.error.__cause__ is error


@pytest.mark.parametrize(
    ("events", "why"),
    [
        ([*RUNNING, ("cancel",)], "its caller no longer wants it"),
        (CANCELING, "somebody else has cancelled it"),
    ],
)
def test_a_cancelled_call_waits_for_no_other_server_when_its_own_is_lost(
    events: list[Event], why: str
) -> None:
    life = lived([*events, ("gone",)])
    assert type(life.outcome.error) is errors.ServerLostError
    assert f"not tried again: {why}" in str(life.outcome.error)


def test_a_call_that_nobody_wants_when_it_begins_leaves_no_timer() -> None:
    life = CallLife(60.0, begin=False)
    life.call.unwanted = True
    life.does(life.call.start)
    assert life.done
    assert life.timers.next_due() is None


@pytest.mark.parametrize("end", ["cancel", "close"])
def test_a_pause_ends_at_once(end: str) -> None:
    life = lived([*LOST])
    assert life.call.state is GoalState.RETRYING
    assert not life.done
    life.happens(end, *([False] if end == "close" else []))
    assert life.done
    assert life.outcome.cancel is not None
    assert life.outcome.cancel.name == "UNKNOWN"  # the lost goal may run on
    assert life.clock == 1000.0


PAUSED_BESIDE_ONE: list[Event] = [*SENT, ("wait", 7.0), ("accepted", 0)]
"""In the pause of a call that tries again at any price; its first goal was accepted late."""
ANY_PRICE = RetryPolicy(jitter=0.0, resend="always", initial=5.0)
END_EARLIER = [
    # How the earlier goal ends, when the call does, and with what.
    (("result", 0, GoalState.CANCELED), 0.0, concurrent.futures.CancelledError),
    (("result", 0, GoalState.SUCCEEDED), 0.0, type(None)),
    (("gone",), 2.0, errors.DeadlineExceededError),
    (("wait", 0.0), 2.0, errors.DeadlineExceededError),
]


@pytest.mark.parametrize(("how", "after", "error"), END_EARLIER)
def test_who_cancels_in_a_pause_waits_for_the_goals_that_run(
    how: Event, after: float, error: type
) -> None:
    life = lived([*PAUSED_BESIDE_ONE, ("cancel",)], retry=ANY_PRICE)
    assert not life.done
    begun = life.clock
    life.happens(*how)
    life.wait_until(begun + after)
    assert life.done
    assert type(life.outcome.error) is error
    if after:
        assert life.outcome.cancel is CancelReport.UNKNOWN
        assert f"{life.outcome.goal_id}" in str(life.outcome.error)


def test_the_budget_forbids_retries_and_counts_each_call() -> None:
    budget = RetryBudget(capacity=2.0)
    life = lived([*LOST], budget=budget)
    assert life.done
    assert "retry budget" in str(life.outcome.error)
    assert budget.tokens == 1.0
    life = lived([*RUNNING, ("result", 0, GoalState.SUCCEEDED)], budget=budget)
    assert life.outcome.error is None
    assert budget.tokens == 1.1


def test_a_late_success_is_taken_in_place_of_another_goal() -> None:
    life = lived([*LOST, *PAUSE, ("result", 0, GoalState.SUCCEEDED), ("ready",)])
    assert life.outcome.error is None
    assert life.outcome.result is not None
    assert life.sends == 1


def test_a_goal_of_a_server_that_fell_silent_is_asked_about_when_the_call_goes_on() -> None:
    """No server becomes ready then, at which each lost goal is asked about."""
    life = lived(RUNNING)
    [goal], [attempt] = life.goals.values(), life.link.listeners.values()
    life.does(attempt.on_server_lost, "its server answered nothing for 1 s")
    asked = goal.asked
    life.wait(0.5)
    assert (life.sends, goal.asked) == (1, asked + 2)  # its result, and to cancel it
    life.result(0, GoalState.SUCCEEDED)
    assert life.outcome.error is None


STATUS_FIRST: list[Event] = [*LOST, *PAUSE, ("status", 0, GoalState.SUCCEEDED), ("back",)]
"""The server of a lost goal is back, and its status says that the goal has succeeded."""


def test_no_goal_is_sent_while_the_success_of_an_earlier_one_is_on_its_way() -> None:
    life = lived(STATUS_FIRST)
    assert life.sends == 1
    life.happens("result", 0, GoalState.SUCCEEDED)
    assert life.outcome.error is None
    assert life.sends == 1


@pytest.mark.parametrize("server", [5.0, None])
def test_the_wait_for_the_result_of_an_earlier_goal_ends(server: float | None) -> None:
    life = lived(STATUS_FIRST, server=server)
    assert life.sends == 1
    life.wait(10.0)
    assert life.sends == 2  # by the policy: the earlier goal has ended
    life.wait(10.0)
    assert life.done


# --- no server (contract C2.7) -----------------------------------------------------------------


@pytest.mark.parametrize("timeout", [None, 3.0, 5.0, 30.0])
def test_no_server_is_one_error_in_the_time_there_is(timeout: float | None) -> None:
    budget = RetryBudget(capacity=2.0)
    life = CallLife(timeout, budget=budget, judged=True, strategies=True)
    enough = min(5.0, timeout or 5.0)
    life.wait(enough - 0.01)
    assert not life.done
    life.wait(0.01)
    error = life.outcome.error
    assert type(error) is errors.ServerUnavailableError
    assert (error.attempts, error.elapsed) == (1, enough)
    assert life.outcome.cancel is CancelReport.NOT_NEEDED
    assert budget.tokens == 2.0
    assert not life.jobs  # neither `classify=` nor a strategy has a say in it


TRANSIENT: Event = ("judge", Verdict.TRANSIENT)
WAITED_IN_VAIN: dict[type[BaseException], list[Event]] = {
    # What happened in a call that then waited in vain for a server to try again.
    errors.GoalRejectedError: [*SENT, ("rejected", 0), ("gone",), TRANSIENT],
    errors.GoalAbortedError: [*RUNNING, ("result", 0, GoalState.ABORTED), ("gone",), TRANSIENT],
    errors.RetriesExhaustedError: [
        *RUNNING,
        ("result", 0, GoalState.SUCCEEDED),
        ("gone",),
        TRANSIENT,
    ],
    errors.ServerLostError: LOST,
    errors.FeedbackStalledError: [*STALLED, ("result", 0, GoalState.CANCELED), ("gone",)],
}
MAY_RUN = (errors.ServerLostError,)


@pytest.mark.parametrize("cls", WAITED_IN_VAIN, ids=lambda cls: cls.__name__)
@pytest.mark.parametrize("timeout", [None, 9.0])
def test_a_call_that_had_a_server_ends_with_what_came_of_it(
    cls: type[BaseException], timeout: float | None
) -> None:
    limits = {"server": 5.0 if timeout is None else None, "feedback": 1.0}
    budget = RetryBudget(capacity=10.0)
    life = lived(
        [*WAITED_IN_VAIN[cls], ("wait", 20.0)],
        judged=True,
        timeout=timeout,
        budget=budget,
        **limits,
    )
    error: Any = life.outcome.error
    assert (life.sends, life.outcome.attempts) == (1, 3 if timeout is None else 2)
    assert budget.tokens == 9.0  # for what the server did, and not for its absence
    assert [event.state for event in life.outcome.timeline][-1] is GoalState.TIMED_OUT
    if timeout is None:
        assert type(error) is cls
        assert "no server was ready within 5 s, and all 3 attempts" in str(error)
        assert error.goal_id == life.outcome.timeline[0].goal_id
        assert not re.search(r"(after|lost) 1\d\.\d s", str(error))  # but when it happened
        return
    assert type(error) is errors.DeadlineExceededError
    if cls in MAY_RUN:
        assert error.cancel is CancelReport.UNKNOWN
        assert error.goal_id == life.outcome.timeline[0].goal_id
    else:
        assert (error.cancel, error.phase) == (CancelReport.NOT_NEEDED, "server")


@pytest.mark.parametrize("ready", [False, True])
def test_only_the_deadline_limits_the_wait_for_its_turn(ready: bool) -> None:
    life = CallLife(server=1.0, begin=not ready)
    life.busy(True)
    life.ready()
    if ready:
        life.does(life.call.start)
    life.wait(100.0)
    assert (life.done, life.sends) == (False, 0)
    life.busy(False)
    assert life.sends == 1


@pytest.mark.parametrize("ready", [False, True])
def test_a_call_without_any_time(ready: bool) -> None:
    life = CallLife(0, begin=False)
    life.link.ready = life.had_server = ready
    life.does(life.call.start)
    life.wait(0.0)
    expected = errors.DeadlineExceededError if ready else errors.ServerUnavailableError
    assert type(life.outcome.error) is expected
    assert life.outcome.cancel is CancelReport.NOT_NEEDED
    assert life.sends == 0


@pytest.mark.parametrize("limit", [5.0, None])
@pytest.mark.parametrize("there", ["back", "twice"])
def test_the_server_of_a_lost_goal_may_leave_until_the_longest_lease_is_over(
    there: str, limit: float | None
) -> None:
    """That takes longer than `Timeouts.server`, which is for the wait for any server."""
    gone = [("gone",)] if there == "back" else []
    life = lived([*RUNNING, *gone, (there,), *PAUSE, ("wait", 29.0)], server=limit)
    assert (life.done, life.sends) == (False, 1)
    life.wait(2.0)
    assert type(life.outcome.error) is errors.ServerLostError
    assert "the server of an earlier goal is still there" in str(life.outcome.error)
    assert (life.sends, life.outcome.attempts) == (1, 2)


@pytest.mark.parametrize("then", ["leaves", "deadline", "all leave"])
def test_it_is_waited_for_until_the_deadline(then: str) -> None:
    life = lived([*RUNNING, ("twice",), *PAUSE, ("wait", 60.0)], timeout=90.0)
    assert (life.done, life.sends) == (False, 1)
    if then == "leaves":
        life.first_leaves()
        assert life.sends == 2
    elif then == "deadline":
        life.wait(31.0)
        assert type(life.outcome.error) is errors.DeadlineExceededError
    else:
        life.gone()
        life.wait(6.0)
        assert life.call.machine.attempts == 3  # no server is there: `Timeouts.server` counts again
        life.ready()
        assert life.sends == 2


def test_a_server_that_comes_back_later_than_it_is_waited_for_once_is_tried() -> None:
    life = lived([*LOST, ("wait", 7.0), ("ready",), ("cancel_answer", 0, UNKNOWN)])
    assert (life.sends, life.call.machine.attempts) == (2, 3)


@pytest.mark.parametrize("limits", [{"server": 2.0}, {"server": None, "timeout": 2.0}])
def test_a_server_of_another_type_that_is_seen_only_when_time_is_up_is_told(
    limits: dict[str, float | None],
) -> None:
    life = CallLife(**limits)  # type: ignore[arg-type]
    life.link.other_types = ("a/action/Other",)
    life.wait(2.1)
    error = life.outcome.error
    assert isinstance(error, errors.ActionTypeMismatchError)
    assert (error.expected, error.served) == (life.type_name, ("a/action/Other",))
    assert (life.sends, life.outcome.attempts) == (0, 1)


# --- what the user's `classify=` has to say (contract C3.3) ------------------------------------

SUCCEEDED: Event = ("result", 0, GoalState.SUCCEEDED)


def test_a_rejection_counts_also_where_the_server_went_out_of_sight_before_it_came() -> None:
    """Else the server, once back, would be asked for ever about a goal that it will not take."""
    life = lived([("ready",), ("gone",), ("rejected", 0)], server=None, accept=None)
    assert isinstance(life.outcome.error, errors.GoalRejectedError)


def test_a_success_judged_transient_is_tried_again_until_it_is_none() -> None:
    life = lived([*RUNNING, SUCCEEDED, ("judge", Verdict.TRANSIENT), *PAUSE], judged=True)
    assert life.sends == 2
    life.happens("accepted", 0)
    life.happens(*SUCCEEDED)
    life.happens("judge", Verdict.SUCCESS)
    life.happens("wait", 0.1)
    assert life.outcome.error is None
    assert life.outcome.attempts == 2


def test_a_success_judged_transient_to_the_last_ends_the_retries() -> None:
    events = [*RUNNING, SUCCEEDED, ("judge", Verdict.TRANSIENT), ("wait", 1.0)]
    life = lived([*3 * events], judged=True)
    assert type(life.outcome.error) is errors.RetriesExhaustedError
    assert life.sends == 3


@pytest.mark.parametrize("end", [GoalState.SUCCEEDED, GoalState.ABORTED])
def test_what_is_judged_permanent_is_not_tried_again(end: GoalState) -> None:
    life = lived(
        [*RUNNING, ("result", 0, end), ("judge", Verdict.PERMANENT), ("wait", 1.0)], judged=True
    )
    assert isinstance(life.outcome.error, errors.PermanentError)
    assert life.sends == 1


def test_a_rejection_judged_transient_is_tried_again_also_by_the_most_careful() -> None:
    careful = RetryPolicy(jitter=0.0, resend="never_accepted")
    life = lived(
        [*SENT, ("rejected", 0), ("judge", Verdict.TRANSIENT), *PAUSE], judged=True, retry=careful
    )
    assert life.sends == 2


def test_a_late_success_is_judged_like_any_other() -> None:
    life = lived([*LOST, *PAUSE, SUCCEEDED, ("ready",)], judged=True)
    life.happens("judge", Verdict.PERMANENT)
    life.happens("wait", 1.0)
    assert isinstance(life.outcome.error, errors.PermanentError)


def test_a_cancel_that_comes_while_a_success_is_judged_does_not_lose_it() -> None:
    life = lived([*RUNNING, SUCCEEDED, ("cancel",), ("judge", Verdict.SUCCESS)], judged=True)
    life.happens("wait", 0.1)
    assert life.outcome.error is None
    assert life.outcome.result is not None


@pytest.mark.parametrize("verdict", ["raises", "nonsense"])
def test_a_function_that_gives_no_verdict_makes_no_success(verdict: str) -> None:
    life = lived([*RUNNING, SUCCEEDED, ("judge", verdict), ("wait", 1.0)], judged=True)
    error = life.outcome.error
    assert type(error) is errors.ClassifyError
    assert error.result is life.outcome.result is not None
    assert (type(error.__cause__) is ValueError) == (verdict == "raises")
    assert life.sends == 1


@pytest.mark.parametrize("verdict", ["raises", "nonsense"])
@pytest.mark.parametrize("end", ["aborted", "rejected"])
def test_a_function_that_gives_no_verdict_leaves_a_failure_its_error(
    end: str, verdict: str
) -> None:
    aborted: list[Event] = [*RUNNING, ("result", 0, GoalState.ABORTED)]
    events: list[Event] = aborted if end == "aborted" else [*SENT, ("rejected", 0)]
    life = lived([*events, ("judge", verdict), ("wait", 1.0)], judged=True)
    expected = errors.GoalAbortedError if end == "aborted" else errors.GoalRejectedError
    assert type(life.outcome.error) is expected
    assert "`classify=CallLife._classify`" in str(life.outcome.error)
    assert life.sends == 1


def test_a_rejection_is_never_judged_a_success() -> None:
    life = lived([*SENT, ("rejected", 0), ("judge", Verdict.SUCCESS)], judged=True)
    error = life.outcome.error
    assert type(error) is errors.ClassifyError
    assert type(error.__cause__) is errors.GoalRejectedError


LATE = [
    # What happens while the function does not answer, when that is enough, and what is told.
    ([], 4.0, 4.0, "call's deadline"),
    ([], None, 10.0, "within 10 s"),
    ([], 30.0, 10.0, "within 10 s"),
    ([("cancel",)], None, 2.0, "cut short: the call was cancelled"),
    ([("cancel",)], 1.0, 1.0, "call's deadline"),
    ([("close", False)], None, 2.0, "cut short: the client was closed"),
    ([("close", True)], None, 2.0, "cut short: the client was closed"),
    ([("wait", 9.0), ("close", False)], None, 10.0, "within 10 s"),
]


@pytest.mark.parametrize(("events", "timeout", "enough", "told"), LATE)
def test_a_function_that_does_not_answer_makes_no_success_and_holds_nothing_up(
    events: list[Event], timeout: float | None, enough: float, told: str
) -> None:
    life = lived([*RUNNING, SUCCEEDED, *events], judged=True, timeout=timeout)
    life.wait_until(1000.0 + enough - 0.1)
    assert not life.done
    life.wait_until(1000.0 + enough + 0.1)
    assert type(life.outcome.error) is errors.ClassifyError
    assert told in str(life.outcome.error)
    assert life.outcome.error.result is not None
    life.happens("judge", Verdict.SUCCESS)  # too late
    assert type(life.outcome.error) is errors.ClassifyError


# --- the communication thread dies -------------------------------------------------------------


@pytest.mark.parametrize("end", [GoalState.SUCCEEDED, GoalState.ABORTED])
def test_a_goal_that_is_being_judged_had_ended_whatever_dies(end: GoalState) -> None:
    life = lived([*RUNNING, ("result", 0, end), ("fail",)], judged=True)
    succeeded = end is GoalState.SUCCEEDED
    expected = errors.ClassifyError if succeeded else errors.GoalAbortedError
    assert type(life.outcome.error) is expected
    assert "cut short: it broke" in str(life.outcome.error)
    assert life.outcome.result is not None


class Busy:
    """Feedback callbacks that never come to an end."""

    errors = 0

    def put(self, *decodes: Any) -> None: ...
    def finish(self, then: Any) -> None: ...
    def close(self) -> None: ...


def test_an_accepted_goal_that_its_server_twice_does_not_know_is_not_watched_on() -> None:
    unknown = ("cancel_answer", 0, UNKNOWN)
    events = [("ready",), ("fire",), ("accepted", 0), unknown, ("wait", 0.5), unknown]
    assert lived(events, accept=1.0).link.listeners == {}


def test_a_result_waits_a_moment_for_the_callbacks_of_earlier_feedback() -> None:
    life = lived([*RUNNING, ("result", 0, GoalState.SUCCEEDED)], callbacks=Busy())
    assert not life.done
    life.wait(1.0)
    assert life.outcome.error is None


@pytest.mark.parametrize("judged", [False, True])
def test_a_result_does_not_wait_for_callbacks_on_a_thread_that_died(judged: bool) -> None:
    events = [*RUNNING, ("result", 0, GoalState.ABORTED), ("fail",)]
    life = lived(events, judged=judged, callbacks=Busy())
    assert isinstance(life.outcome.error, errors.GoalAbortedError)


# --- the user's strategies ---------------------------------------------------------------------


def test_strategies_decide_off_the_thread() -> None:
    life = lived([*LOST, ("judge", None)], strategies=True)
    assert life.call.state is GoalState.RETRYING
    life.happens("wait", 0.25)
    assert life.call.machine.attempts == 2


@pytest.mark.parametrize("how", ["stop raises", "wait raises", "nonsense"])
def test_a_strategy_that_fails_ends_the_call_with_the_last_failure(how: str) -> None:
    life = lived([*LOST, ("judge", None, how)], strategies=True)
    error = life.outcome.error
    assert type(error) is errors.RetriesExhaustedError
    assert "was lost" in str(error)
    assert f"`RetryPolicy.{'wait' if how == 'wait raises' else 'stop'}=CallLife._" in str(error)
    raised = "raises" in how
    assert type(error.__cause__) is (ValueError if raised else errors.ServerLostError)


@pytest.mark.parametrize(("timeout", "enough"), [(None, 10.0), (4.0, 4.0), (30.0, 10.0)])
def test_a_strategy_that_does_not_answer_ends_the_call(
    timeout: float | None, enough: float
) -> None:
    life = lived([*LOST], strategies=True, timeout=timeout)
    life.wait_until(1000.0 + enough - 0.1)
    assert not life.done
    life.wait_until(1000.0 + enough + 0.1)
    assert type(life.outcome.error) is errors.RetriesExhaustedError
    assert "did not answer" in str(life.outcome.error)
    assert type(life.outcome.error.__cause__) is errors.ServerLostError
    life.happens("judge", None)  # too late
    life.happens("wait", 1.0)
    assert life.sends == 1


@pytest.mark.parametrize("end", [("cancel",), ("close", False), ("close", True)], ids=str)
def test_a_call_whose_strategy_is_asked_ends_at_once(end: Event) -> None:
    life = lived([*LOST, end], strategies=True)
    assert life.done
    assert life.clock == 1000.0
    life.happens("judge", None)
    life.happens("wait", 1.0)
    assert life.sends == 1


def test_a_late_success_is_taken_while_a_strategy_is_asked() -> None:
    life = lived([*LOST, ("result", 0, GoalState.SUCCEEDED), ("wait", 0.1)], strategies=True)
    assert life.outcome.error is None
    life.happens("judge", None)
    assert life.sends == 1


def test_the_time_that_a_strategy_took_counts_against_the_deadline() -> None:
    life = lived([*LOST, ("wait", 3.9), ("judge", None)], strategies=True, timeout=4.0)
    assert isinstance(life.outcome.error, errors.ServerLostError)
    assert "crossed the deadline" in str(life.outcome.error)

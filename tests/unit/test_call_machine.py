"""What a call does at each event: effects in full, as a table of its promises.

`test_call_explored` visits all orders of events, `test_call_properties` has those that are easily
got wrong. Here is what users read, and what is told of a goal at an end.
"""

from __future__ import annotations

import uuid
from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from actionkit import GoalFate, GoalReport, GoalState, Verdict
from actionkit._calls.retries.retry import GiveUp, Retry
from actionkit._calls.sending import effects as cx
from actionkit._calls.sending.machine import CallMachine, Phase
from actionkit._goal import effects as fx
from actionkit._goal.effects import End, Ending, LastNews
from actionkit._goal.facts import GoalFacts
from actionkit._goal.stages import CancelReason

NOW = 10.0
CLOSED, CANCELLED = CancelReason.CLOSED, CancelReason.CANCELLED
ABORTED = Ending(End.ABORTED, GoalState.ABORTED, result="half of it")
LOST = Ending(End.LOST, GoalState.LOST, news=LastNews.SERVER_GONE)
SUCCEEDED = Ending(End.SUCCEEDED, GoalState.SUCCEEDED, result="all of it")
WHY = "its server is gone, or silent"
GIVEN_UP = replace(LOST, given_up=True)
REPLACED = Ending(End.REPLACED, GoalState.REPLACED, given_up=True)
UNCONFIRMED = Ending(End.DEADLINE, GoalState.TIMED_OUT, phase="cancel", given_up=True)
NOT_CONFIRMED = replace(UNCONFIRMED, lost_because=WHY)
RUNS: dict[str, Any] = {"accepted": True}
SILENT: dict[str, Any] = {"accepted": True, "lost": True}
GONE: dict[str, Any] = {"accepted": True, "lost": True, "servers_gone": True}
OVER: dict[str, Any] = {"over": True, "ended": True}


class Sent:
    """An attempt, as far as its call looks at it. `in_sight` means that its server may confirm."""

    def __init__(
        self,
        goal_id: uuid.UUID,
        *,
        ours: bool = False,
        awaits: GoalState | None = None,
        in_sight: bool = False,
        **facts: Any,
    ) -> None:
        self.goal_id = goal_id
        self.cancel_is_ours = ours
        known = GoalFacts(goal_id, **facts)
        self.goal: Any = SimpleNamespace(facts=known, awaits_result_of=awaits, may_run=in_sight)

    def give_up(self, why: CancelReason, *, abandon: bool = False) -> None: ...
    def on_server_ready(self) -> None: ...
    def end_grace(self) -> None: ...
    def fail(self, reason: str, error: BaseException) -> None: ...

    def stop(self) -> None:
        self.goal.facts.over = self.goal.facts.ended = True
        self.goal.may_run = False


def call(
    resend: str = "confirmed_stopped",
    limit: float | None = 5.0,
    deadline: float | None = None,
    **options: Any,
) -> CallMachine:
    numbers = iter(range(2, 99))
    return CallMachine(
        uuid.UUID(int=1), resend, limit, deadline, lambda: uuid.UUID(int=next(numbers)), **options
    )


def is_in(machine: CallMachine, phase: Phase) -> bool:
    return machine.phase is phase


def send(machine: CallMachine, **facts: Any) -> Sent:
    """Send the goal of an attempt that has begun."""
    assert machine.server_ready() == [cx.Queue()]
    assert machine.turn(NOW) == [cx.Send()]
    assert is_in(machine, Phase.TRYING)
    attempt = Sent(machine.latest_id, **facts)
    machine.sent(attempt)
    return attempt


def sent(machine: CallMachine, **facts: Any) -> Sent:
    machine.begin(None, NOW)
    return send(machine, **facts)


def paused(machine: CallMachine, ending: Ending = LOST, **facts: Any) -> Sent:
    """Let the attempt end, and a pause begin."""
    attempt = send(machine, **facts)
    assert machine.ended(attempt, ending) == [cx.Judge(ending)]
    error = RuntimeError("as an exception")
    planning = [cx.Count(success=False), cx.Plan(ending)]
    assert machine.judged(ending, error, Verdict.TRANSIENT) == planning
    assert is_in(machine, Phase.PLANNING)
    assert machine.cause is error
    pausing = [fx.Record(GoalState.RETRYING, "in 1.50 s"), cx.Pause(1.5)]
    assert machine.planned(ending, Retry(1.5)) == pausing
    assert is_in(machine, Phase.PAUSING)
    return attempt


def pause(machine: CallMachine, ending: Ending = LOST, **facts: Any) -> Sent:
    machine.begin(None, NOW)
    return paused(machine, ending, **facts)


def in_a_pause(resend: str = "confirmed_stopped", ending: Ending = LOST, **facts: Any) -> Any:
    machine = call(resend)
    return machine, pause(machine, ending, **facts)


def ends(ending: Ending) -> list[cx.Effect]:
    return [cx.StopRetrying(), cx.Finish(ending)]


def begin(machine: CallMachine) -> None:
    machine.begin(None, NOW)


def queue(machine: CallMachine) -> None:
    machine.begin(None, NOW)
    machine.server_ready()


def change(machine: CallMachine, **values: Any) -> None:
    for name, value in values.items():
        setattr(machine, name, value)


def judge(machine: CallMachine, ending: Ending, verdict: Verdict, **facts: Any) -> Any:
    machine.ended(sent(machine, **facts), ending)
    return machine.judged(ending, None, verdict)


def fail(machine: CallMachine, **values: Any) -> Any:
    """Lose the goal of the first attempt, and judge that it may be tried again."""
    machine.ended(sent(machine, **GONE), LOST)
    change(machine, **values)
    return machine.judged(LOST, None, Verdict.TRANSIENT)


def with_goals(machine: CallMachine, ending: Ending, **changes: Any) -> Ending:
    return replace(ending, goals=machine.goals.reports, **changes)


def taker(phase: Phase, *, accepted: bool = False) -> Any:
    goals = SimpleNamespace(accepted=accepted)
    return SimpleNamespace(phase=phase, goals=goals, goal_id=uuid.UUID(int=77))


BY = fx.Record(GoalState.REPLACED, f"by goal {uuid.UUID(int=77)}")


# --- how it ends -------------------------------------------------------------------------------

ERROR, THAT_WAS_IT = ValueError("order"), GiveUp("that was it")
UNWANTED, SHUT = "its caller no longer wants it", "the client was closed"
EARLIER = (GoalReport(uuid.UUID(int=5), GoalFate.RUNNING),)
SENDING, TIMED_OUT = GoalState.SENDING, GoalState.TIMED_OUT
FAILED = cx.Count(success=False)


def by_caller(state: GoalState) -> list[Any]:
    return ends(Ending(End.CANCELLED_BY_CALLER, state, given_up=True))


def too_late(phase: str, waiting: str) -> list[Any]:
    ending = Ending(End.DEADLINE, TIMED_OUT, phase=phase, given_up=True)
    return [fx.Record(TIMED_OUT, waiting), *ends(ending)]


def not_retried(why: str) -> list[Any]:
    return ends(replace(LOST, not_retried=why))


ENDS: dict[str, tuple[Callable[[CallMachine], list[Any]], list[Any]]] = {
    # Before its goal is sent.
    "an invalid goal is not sent":
        (lambda m: [m.begin(ERROR, NOW)],
         ends(Ending(End.INVALID, GoalState.REJECTED, error=ERROR))),
    "the middleware does not take the goal":
        (lambda m: [queue(m), m.turn(NOW), m.send_failed(ERROR)],
         ends(Ending(End.INVALID, SENDING, error=ERROR))),
    "another type ends the call and is told":
        (lambda m: [begin(m), m.type_mismatch(("a/action/B",))],
         ends(Ending(End.TYPE_MISMATCH, SENDING, served=("a/action/B",)))),
    "nothing is sent in place of goals that may run":
        (lambda m: [m.not_replacing(EARLIER)],
         ends(Ending(End.NOT_REPLACING, SENDING, earlier=EARLIER, given_up=True))),
    "the deadline passes before the goal that it replaces stops":
        (lambda m: [m.waited(NOW, ready=True)],
         too_late("replace", "waiting for the goal that it replaces to stop")),
    "the deadline passes in the queue":
        (lambda m: [queue(m), m.waited(NOW, ready=True)], too_late("accept", "waiting to be sent")),
    "no server comes":
        (lambda m: [begin(m), m.waited(15.0, ready=False)],
         [fx.Record(TIMED_OUT, "waiting for a server"), cx.StopRetrying(),
          *ends(Ending(End.NO_SERVER, TIMED_OUT, given_up=True))]),
    "a goal whose caller is about to cancel is not sent":
        (lambda m: [queue(m), change(m, unwanted=True), m.turn(NOW)], by_caller(SENDING)),
    "what breaks before the goal was sent ends the call":
        (lambda m: [begin(m), m.broke(ERROR)], ends(Ending(End.LOST, GoalState.LOST, error=ERROR))),
    "a call without a goal in flight is replaced":
        (lambda m: [begin(m), m.replace_by(taker(Phase.NEW))],
         [cx.StopRetrying(), BY, cx.Finish(REPLACED)]),
    # By a verdict.
    "a success gives a token back":
        (lambda m: [judge(m, SUCCEEDED, Verdict.SUCCESS, **OVER)],
         [cx.Count(success=True), *ends(SUCCEEDED)]),
    "a failure that does not pass takes no token":
        (lambda m: [judge(m, ABORTED, Verdict.PERMANENT, **OVER)], ends(ABORTED)),
    "a failure that may pass is not tried again if its caller cancels":
        (lambda m: [fail(m, unwanted=True)], [FAILED, *not_retried(UNWANTED)]),
    "nor if its client is closed":
        (lambda m: [fail(m, closes_because=SHUT)], [FAILED, *not_retried(SHUT)]),
    "nor if both happen":
        (lambda m: [fail(m, unwanted=True, closes_because=SHUT)], [FAILED, *not_retried(UNWANTED)]),
    "nor if it is replaced":
        (lambda m: [fail(m, _replacement=call())],
         [FAILED, *not_retried("its caller has sent another goal in its place")]),
    "nor if somebody else has cancelled it":
        (lambda m: [judge(m, LOST, Verdict.TRANSIENT, **GONE, others_cancel=True)],
         [FAILED, *not_retried("somebody else has cancelled it")]),
    "the plan may be to give up":
        (lambda m: [fail(m), m.planned(LOST, THAT_WAS_IT)], not_retried("that was it")),
    "the plan may be to give up because no server came":
        (lambda m: [fail(m), m.planned(replace(LOST, not_retried="no server came"), THAT_WAS_IT)],
         not_retried("no server came, and that was it")),
    # It is given up between attempts (contract C2.8).
    "it describes the last goal if that has stopped":
        (lambda m: [pause(m, ABORTED, **OVER), m.give_up(CANCELLED)], by_caller(GoalState.ABORTED)),
    "it was cancelled before the next goal was sent":
        (lambda m: [pause(m, ABORTED, **OVER), m.resume(NOW), m.give_up(CANCELLED)],
         by_caller(SENDING)),
    "the last goal was lost, and may run when the client closes":
        (lambda m: [pause(m, **GONE), change(m, closes_because=SHUT), m.give_up(CLOSED)],
         ends(replace(GIVEN_UP, end=End.CLOSED, lost_because=SHUT))),
    "the last goal was lost, and may run when its caller cancels":
        (lambda m: [pause(m, **GONE), m.give_up(CANCELLED)],
         ends(replace(NOT_CONFIRMED, news=LastNews.SERVER_GONE))),
    "a pause ends at the deadline":
        (lambda m: [pause(m, **GONE), m.waited(NOW, ready=False)],
         not_retried("the pause reached the deadline")),
}  # fmt: skip


@pytest.mark.parametrize(("events", "effects"), ENDS.values(), ids=list(ENDS))
def test_a_call_ends(events: Callable[[CallMachine], list[Any]], effects: list[Any]) -> None:
    machine = call()
    *before, finish = effects
    told = events(machine)[-1]
    assert told == [*before, cx.Finish(with_goals(machine, finish.ending))]
    assert machine.begin(None, NOW) == machine.turn(NOW) == []


# --- until a goal is sent ----------------------------------------------------------------------


@pytest.mark.parametrize(("limit", "until"), [(5.0, 15.0), (None, None)])
def test_it_waits_for_a_server_as_long_as_the_timeout_says(
    limit: float | None, until: float | None
) -> None:
    sending = fx.Record(GoalState.SENDING)
    assert call(limit=limit).begin(None, NOW) == [sending, cx.AwaitServer(until)]
    attached = call(limit=limit, attaches=True)
    assert attached.begin(None, NOW) == [cx.AwaitServer(until)]  # somebody has sent it


@pytest.mark.parametrize("before", [lambda machine: None, begin, queue])
@pytest.mark.parametrize(
    ("why", "closing", "end", "because"),
    [
        (CANCELLED, "", End.CANCELLED_BY_CALLER, ""),
        (CANCELLED, "ROS was shut down", End.CANCELLED_BY_CALLER, ""),
        (CLOSED, "ROS was shut down", End.CLOSED, "ROS was shut down"),
        (CLOSED, "", End.CLOSED, ""),
    ],
)
def test_a_call_that_is_given_up_before_its_goal_was_sent_sends_none(
    before: Callable[[CallMachine], None], why: CancelReason, closing: str, end: End, because: str
) -> None:
    machine = call()
    before(machine)
    if closing:
        machine.closes_because = closing
    given_up = Ending(end, GoalState.SENDING, given_up=True, lost_because=because)
    assert machine.give_up(why) == ends(given_up)
    assert machine.turn(NOW) == []


def test_the_ids_of_later_goals_come_from_the_ledger() -> None:
    machine = call()
    machine.use_ids(lambda number: uuid.UUID(int=100 + number))
    machine.begin(None, NOW)
    assert machine.goal_id == uuid.UUID(int=1)
    paused(machine, ABORTED, over=True)
    machine.resume(NOW)
    assert machine.goal_id == machine.latest_id == uuid.UUID(int=102)


# --- may another goal be sent? (contract C4.2) -------------------------------------------------


@pytest.mark.parametrize(
    ("resend", "earlier", "may"),
    [
        ("always", RUNS, True),
        ("server_gone", RUNS, False),
        ("server_gone", SILENT, False),
        ("server_gone", GONE, True),
        ("confirmed_stopped", GONE, False),
        ("confirmed_stopped", OVER, True),
        ("never_accepted", GONE, False),
        # It has ended, and its result may come.
        ("confirmed_stopped", OVER | {"awaits": GoalState.SUCCEEDED}, False),
        ("confirmed_stopped", OVER | {"awaits": GoalState.SUCCEEDED, "ours": True}, False),
        ("confirmed_stopped", OVER | {"awaits": GoalState.CANCELED}, False),
        ("confirmed_stopped", OVER | {"awaits": GoalState.CANCELED, "ours": True}, True),
    ],
)
def test_whether_another_goal_may_be_sent_now(
    resend: str, earlier: dict[str, Any], may: bool
) -> None:
    machine = call(resend)
    assert machine.may_send()
    machine.earlier = [Sent(uuid.uuid4(), **OVER), Sent(uuid.uuid4(), **earlier)]
    assert machine.may_send() is may
    machine.earlier.reverse()
    assert machine.may_send() is may


@pytest.mark.parametrize(
    ("resend", "limit", "deadline", "earlier", "until"),
    [
        # For its server to leave the graph: its lease, or what the caller allows if that is more.
        ("server_gone", 5.0, None, SILENT, 50.0),
        ("server_gone", 60.0, None, SILENT, 80.0),
        ("server_gone", None, None, SILENT, 50.0),
        ("server_gone", 5.0, 90.0, SILENT, 90.0),
        # For news that it does not run: as long as for a server.
        ("confirmed_stopped", 5.0, None, SILENT, 25.0),
        ("server_gone", 5.0, None, OVER | {"awaits": GoalState.SUCCEEDED}, 25.0),
    ],
)
def test_it_waits_while_an_earlier_goal_may_run(
    resend: str,
    limit: float | None,
    deadline: float | None,
    earlier: dict[str, Any],
    until: float,
) -> None:
    machine = call(resend, limit, deadline)
    machine.begin(None, NOW)
    paused(machine, LOST, **earlier)
    machine.resume(20.0)
    machine.server_ready()
    assert machine.turn(20.0) == [cx.AwaitServer(until, another=True)]
    waits_for_earlier = resend == "server_gone" and earlier is SILENT
    again = None if limit is None else 21.0 + limit
    assert machine.server_lost(21.0) == ([cx.AwaitServer(again)] if waits_for_earlier else [])


def test_nothing_is_sent_after_the_deadline() -> None:
    machine = call(deadline=20.0)
    queue(machine)
    assert machine.turn(20.0) == [cx.AwaitServer(15.0, another=True)]
    machine = call(deadline=20.0)
    queue(machine)
    assert machine.turn(19.9) == [cx.Send()]


@pytest.mark.parametrize("before", [begin, queue])
def test_a_goal_in_the_queue_waits_again_when_the_last_server_leaves(
    before: Callable[[CallMachine], None],
) -> None:
    machine = call()
    before(machine)
    assert machine.is_waiting
    again: list[cx.Effect] = [cx.AwaitServer(17.0)]
    assert machine.server_lost(12.0) == (again if before is queue else [])
    send(machine)
    assert not machine.is_waiting


# --- what follows from an end ------------------------------------------------------------------


@pytest.mark.parametrize("seen", ["in the pause", "at its turn", "when no server came"])
def test_what_somebody_else_cancels_is_not_tried_again_after_the_verdict_either(seen: str) -> None:
    """The error names the goal that was sent, not the next one."""
    machine, attempt = in_a_pause(**OVER)
    if seen != "in the pause":
        machine.resume(NOW)
    if seen == "at its turn":
        machine.server_ready()
    attempt.goal.facts.others_cancel = True
    at = {"in the pause": machine.resume, "at its turn": machine.turn}
    effects = at.get(seen, lambda now: machine.waited(now, ready=False))(NOW)
    ending = with_goals(machine, LOST, not_retried="somebody else has cancelled it")
    assert effects == ends(ending)
    assert machine.goal_id == attempt.goal_id


def test_a_goal_of_somebody_else_is_followed_also_if_it_is_being_cancelled() -> None:
    attached = call(attaches=True)
    queue(attached)
    attached.goals.facts_left[0].others_cancel = True
    assert attached.turn(NOW) == [cx.Send()]


def test_news_of_another_attempt_ends_nothing() -> None:
    machine = call()
    sent(machine)
    assert machine.ended(Sent(uuid.uuid4()), LOST) == []


# --- late results (contract C4.3) --------------------------------------------------------------


@pytest.mark.parametrize(
    ("state", "ours", "end"),
    [
        (GoalState.SUCCEEDED, False, End.SUCCEEDED),
        (GoalState.ABORTED, False, End.ABORTED),
        (GoalState.REJECTED, False, End.REJECTED),
        (GoalState.CANCELED, False, End.CANCELED_BY_OTHER),
        (GoalState.CANCELED, True, None),
    ],
)
def test_an_earlier_goal_turns_out_to_have_ended(
    state: GoalState, ours: bool, end: End | None
) -> None:
    machine, attempt = in_a_pause(**GONE, ours=ours)
    machine.resume(NOW)
    assert machine.goal_id == uuid.UUID(int=2)
    effects = machine.late_result(attempt, state, "late")
    if end is None:
        assert effects == []
        return
    ending = Ending(end, state, result="late", rejected=state is GoalState.REJECTED)
    assert effects == [cx.StopRetrying(), cx.Judge(ending)]
    assert machine.goal_id == attempt.goal_id


@pytest.mark.parametrize("seen", ["in the pause", "when no server came"])
def test_the_outcome_names_the_goal_whose_late_end_it_describes(seen: str) -> None:
    """Also if nothing is sent any more, and the goal after it had ended before."""
    machine, first = in_a_pause("server_gone", **GONE)
    machine.resume(NOW)
    paused(machine, **GONE)
    (_, judging) = machine.late_result(first, GoalState.ABORTED, "late")
    machine.judged(judging.ending, None, Verdict.TRANSIENT)
    machine.planned(judging.ending, Retry(1.5))
    if seen == "in the pause":
        first.goal.facts.others_cancel = True
        effects = machine.resume(NOW)
        why = "somebody else has cancelled it"
        assert effects == ends(with_goals(machine, judging.ending, not_retried=why))
    else:
        machine.resume(NOW)
        (*_, planning) = machine.waited(NOW, ready=False)
        assert planning.ending.status is GoalState.ABORTED
    assert machine.goal_id == first.goal_id


def test_the_result_of_another_goal_or_beside_one_in_flight_ends_nothing() -> None:
    machine, attempt = in_a_pause("always", **RUNS)
    assert machine.late_result(Sent(attempt.goal_id), GoalState.SUCCEEDED, "late") == []
    machine.resume(NOW)
    send(machine)
    assert machine.late_result(attempt, GoalState.SUCCEEDED, "late") == []


# --- giving up between attempts (contract C2.8) ------------------------------------------------


def test_it_waits_for_what_a_server_in_sight_may_confirm() -> None:
    machine, attempt = in_a_pause("always", **RUNS, in_sight=True)
    assert machine.end_grace("no time is left") == []
    assert machine.give_up(CANCELLED) == [cx.StopRetrying(), cx.AwaitEarlier()]
    assert machine.earlier_over() == []
    attempt.stop()
    ending = replace(GIVEN_UP, end=End.CANCELLED_BY_CALLER)
    effects = machine.earlier_over()
    assert effects == [cx.StopAwaiting(), cx.Finish(with_goals(machine, ending))]


def test_it_waits_no_more_when_the_server_goes_out_of_sight_and_says_so() -> None:
    machine, attempt = in_a_pause("always", **RUNS, in_sight=True)
    machine.give_up(CANCELLED)
    attempt.goal.may_run = False
    ending = with_goals(machine, NOT_CONFIRMED, news=LastNews.SERVER_GONE)
    assert machine.earlier_over() == [cx.StopAwaiting(), cx.Finish(ending)]


def test_it_names_the_latest_goal_that_may_run_if_no_server_confirms_it_in_time() -> None:
    machine, _ = in_a_pause("always", **RUNS, in_sight=True)
    for _ in range(2):
        machine.resume(NOW)
        paused(machine, **RUNS, in_sight=True)
    machine.resume(NOW)
    machine.give_up(CANCELLED)
    effects = machine.end_grace("no time is left")
    assert effects == [cx.StopAwaiting(), cx.Finish(with_goals(machine, UNCONFIRMED))]
    assert machine.goal_id == uuid.UUID(int=3)
    assert [report.goal_id.int for report in machine.goals.reports] == [1, 2, 3]


@pytest.mark.parametrize(
    ("closing", "why"), [("", "the call was cancelled"), ("it broke", "the client was closed")]
)
def test_who_gives_up_while_an_end_is_judged_waits_for_the_verdict(closing: str, why: str) -> None:
    machine = call()
    attempt = sent(machine, **OVER)
    machine.ended(attempt, SUCCEEDED)
    machine.closes_because = closing
    assert machine.give_up(CANCELLED) == [cx.CutJudging(why, at_once=False)]
    assert machine.end_grace("no time is left") == [cx.CutJudging("no time is left", at_once=True)]
    assert machine.broke(RuntimeError()) == [cx.CutJudging(closing, at_once=True)]


# --- another goal in its place (contract C1.15) ------------------------------------------------


@pytest.mark.parametrize("other", [taker(Phase.NEW), taker(Phase.ENDED, accepted=True)])
@pytest.mark.parametrize("end", [End.REJECTED, End.ABORTED, End.CANCELED_BY_OTHER])
def test_a_goal_that_its_server_stops_for_another_ends_as_replaced(other: Any, end: End) -> None:
    machine = call()
    attempt = sent(machine, **OVER)
    assert machine.replace_by(other) == []
    effects = machine.ended(attempt, replace(ABORTED, end=end))
    ending = replace(ABORTED, end=End.REPLACED, status=GoalState.REPLACED, given_up=True)
    assert effects == [cx.StopRetrying(), BY, cx.Finish(with_goals(machine, ending))]


def test_a_goal_is_not_replaced_by_one_that_was_refused_and_may_succeed() -> None:
    for other, ending in ((taker(Phase.ENDED), ABORTED), (taker(Phase.NEW), SUCCEEDED)):
        machine = call()
        attempt = sent(machine, **OVER)
        machine.replace_by(other)
        assert machine.ended(attempt, ending) == [cx.Judge(ending)]
    success = machine.judged(SUCCEEDED, None, Verdict.SUCCESS)
    assert success == [cx.Count(success=True), *ends(with_goals(machine, SUCCEEDED))]


def test_a_call_of_a_goal_of_somebody_else_waits_for_it_when_it_is_replaced() -> None:
    attached = call(attaches=True)
    attached.begin(None, NOW)
    assert attached.replace_by(taker(Phase.NEW)) == [cx.AwaitEarlier()]  # its goal may run


def test_a_goal_is_not_replaced_while_an_earlier_one_of_its_call_may_run() -> None:
    machine, _ = in_a_pause("always", **GONE)
    machine.resume(NOW)
    attempt = send(machine, **OVER)
    machine.replace_by(taker(Phase.NEW))
    effects = machine.ended(attempt, ABORTED)
    ending = with_goals(machine, NOT_CONFIRMED)
    assert effects == ends(ending)  # without the result, which is of no use


# --- a goal that somebody else has sent (contract C1.16) ---------------------------------------


def test_a_goal_that_is_not_followed_yet_may_run() -> None:
    assert call(attaches=True).goals.reports == (GoalReport(uuid.UUID(int=1), GoalFate.LEFT),)
    assert call().goals.reports == ()


@pytest.mark.parametrize("before", [lambda machine: None, begin, queue])
def test_it_is_cancelled_as_soon_as_a_server_is_there(
    before: Callable[[CallMachine], None],
) -> None:
    machine = call(attaches=True)
    before(machine)
    assert machine.end_grace("no time is left") == []  # nobody has cancelled it
    assert machine.give_up(CANCELLED) == [cx.AwaitEarlier()]
    assert machine.give_up(CLOSED) == []
    ending = with_goals(machine, NOT_CONFIRMED)
    assert machine.end_grace("no time is left") == [cx.StopAwaiting(), *ends(ending)]
    assert machine.end_grace("no time is left") == machine.give_up(CANCELLED) == []


def test_it_is_followed_though_its_caller_is_about_to_cancel() -> None:
    machine = call(attaches=True)
    queue(machine)
    machine.unwanted = True
    machine.give_up(CANCELLED)
    assert machine.turn(NOW) == [cx.Send()]
    attempt = Sent(machine.goal_id, **OVER)
    machine.sent(attempt)
    machine.ended(attempt, SUCCEEDED)
    assert machine.give_up(CANCELLED) == [cx.CutJudging("the call was cancelled", at_once=False)]


def test_closing_leaves_it_alone() -> None:
    machine = call(attaches=True)
    machine.begin(None, NOW)
    closed = Ending(End.CLOSED, GoalState.SENDING, given_up=True)
    assert machine.give_up(CLOSED) == ends(with_goals(machine, closed))


# --- a goal that an earlier call with the key has sent (contract C1.17) --------------------------


def rejoined(
    ending: Ending, *, seen_running: bool = False, deadline: float | None = None
) -> tuple[CallMachine, list[cx.Effect]]:
    """A call whose key's goal was the second of an earlier call, and has ended so."""
    machine = call(attaches=True, keyed=True)
    machine.use_ids(lambda number: uuid.UUID(int=100 + number), sent_before=1)
    queue(machine)
    machine.turn(NOW)
    attempt = Sent(machine.goal_id, **OVER)
    machine.sent(attempt)
    machine.seen_running, machine._deadline = seen_running, deadline
    return machine, machine.ended(attempt, ending)


def test_a_goal_that_had_failed_before_the_call_does_not_count_as_an_attempt() -> None:
    machine, effects = rejoined(ABORTED)
    assert effects == [cx.Judge(ABORTED)]
    assert machine.judged(ABORTED, None, Verdict.PERMANENT) == [cx.Pause(0.0)]
    machine.resume(NOW)
    assert (machine.goal_id, machine.attempts, machine.number) == (uuid.UUID(int=103), 1, 3)
    machine.server_ready()
    assert machine.turn(NOW) == [cx.Send()]
    assert not machine.attaches


@pytest.mark.parametrize("verdict", [Verdict.SUCCESS, fx.Fault("it raised ValueError")])
def test_a_goal_that_may_have_succeeded_before_the_call_is_not_sent_again(
    verdict: Verdict | fx.Fault,
) -> None:
    machine, _ = rejoined(ABORTED)
    machine.judged(ABORTED, None, verdict)
    assert is_in(machine, Phase.ENDED)


def test_a_goal_that_has_failed_since_then_is_judged() -> None:
    machine, _ = rejoined(ABORTED, seen_running=True)
    assert machine.judged(ABORTED, None, Verdict.PERMANENT) == ends(with_goals(machine, ABORTED))


@pytest.mark.parametrize("ends_for", ["unwanted", "closes_because"])
def test_no_other_goal_is_sent_that_nobody_wants(ends_for: str) -> None:
    machine, _ = rejoined(ABORTED)
    setattr(machine, ends_for, "the client was closed")
    machine.judged(ABORTED, None, Verdict.PERMANENT)
    assert is_in(machine, Phase.ENDED)


def test_no_other_goal_is_sent_if_the_call_is_replaced() -> None:
    machine, _ = rejoined(ABORTED)
    machine.replace_by(call())
    machine.judged(ABORTED, None, Verdict.PERMANENT)
    assert is_in(machine, Phase.ENDED)


@pytest.mark.parametrize("comes", [False, True])
def test_after_the_deadline_it_waits_for_a_server_that_cancels_the_goal(comes: bool) -> None:
    machine = call(attaches=True, keyed=True)
    machine._deadline = NOW
    machine.begin(None, NOW)
    late = fx.Record(GoalState.TIMED_OUT, "waiting for a server")
    assert machine.waited(NOW, ready=False, cancels=True) == [late, cx.AwaitEarlier()]
    assert machine.waited(NOW, ready=False, cancels=True) == []
    no_server = Ending(End.NO_SERVER, GoalState.TIMED_OUT, given_up=True)
    if comes:
        machine.server_ready()
        assert machine.turn(NOW) == [cx.Send()]
        assert machine.is_late
    else:
        last = ends(with_goals(machine, no_server))
        assert machine.end_grace("") == [cx.StopAwaiting(), *last]


def test_no_other_goal_is_sent_after_the_deadline() -> None:
    machine, _ = rejoined(ABORTED, deadline=NOW)
    machine.judged(ABORTED, None, Verdict.PERMANENT)
    machine.resume(NOW)
    assert machine.ending is not None
    assert machine.ending.end is End.DEADLINE

"""What servers on frameworks in Python do that others do not, judged by their own logs."""

from __future__ import annotations

import signal
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import pytest

from actionkit import (
    AcceptanceTimeoutError,
    CancelReport,
    DeadlineExceededError,
    GoalAbortedError,
    GoalCanceledError,
    GoalFuture,
    GoalNotReplacedError,
    GoalState,
    ServerLostError,
    Timeouts,
)
from tests.field.conftest import Field
from tests.field.kind import Kind, Server
from tests.field.kinds.python import (
    CANCELLED,
    CTRL_C,
    DOCK,
    EXCEPTION,
    MIXED_UP,
    SECOND,
    SIMPLE_ACTIONS,
    SYNCHROS2,
    THIRD,
    program,
)
from tests.waiting import until

SOON = Timeouts(server=30.0, cancel=0.5)
IMPATIENT = Timeouts(server=30.0, accept=0.5, cancel=0.5)
PATIENT = Timeouts(server=30.0, accept=30.0, cancel=30.0)
TOLD = "says that it may run"


def only(kind: Kind) -> Any:
    """Return whether a server is this one."""
    return lambda one: one is kind


def _start(field: Field, *words: str) -> None:
    """Start it in another way."""
    field.server.close()
    field.server = Server(replace(field.kind, program=lambda: program(*words)))
    field.stack.callback(field.server.close)


# -- simple_actions on one thread: while a goal runs, it answers nothing, cancels included ----


def _is_told(field: Field, future: GoalFuture[Any, Any], error: type[Exception]) -> None:
    """The call ends while the goal runs, and says so; the client learns when the goal ends."""
    outcome = future.outcome()
    assert not field.server.count("succeeded")
    assert isinstance(outcome.error, error)
    assert outcome.cancel is CancelReport.UNKNOWN
    assert "IT MAY STILL BE RUNNING" in str(outcome.error)
    assert future.known_to_run
    field.server.wait_for("succeeded")
    until(lambda: not future.known_to_run)
    assert field.server.count("executing") == 1
    field.saw(TOLD)


def _busy(field: Field) -> GoalFuture[Any, Any]:
    """Make the server busy for longer than the test; the client is soon closed at its end."""
    client = field.another_client(timeouts=SOON)
    future = client.call_async(field.goal("busy for long"))
    field.server.wait_for("executing")
    return future


@pytest.mark.field("Deadline", can=only(SIMPLE_ACTIONS))
def test_a_busy_server_lets_a_deadline_pass(field: Field) -> None:
    client = field.another_client(timeouts=SOON)
    future = client.call_async(field.goal("busy"), timeout=0.5)
    _is_told(field, future, DeadlineExceededError)


@pytest.mark.field("Cancel", can=only(SIMPLE_ACTIONS))
def test_a_busy_server_answers_a_cancel_too_late(field: Field) -> None:
    client = field.another_client(timeouts=SOON)
    future = client.call_async(field.goal("busy"))
    field.server.wait_for("executing")
    future.cancel()
    _is_told(field, future, DeadlineExceededError)
    field.told(CANCELLED, "`DeadlineExceededError`: it may still be running")


@pytest.mark.field("At once", can=only(SIMPLE_ACTIONS))
def test_a_busy_server_answers_a_cancel_at_once_too_late(field: Field) -> None:
    client = field.another_client(timeouts=SOON)
    future = client.call_async(field.goal("busy"))
    future.wait_accepted()
    future.cancel()
    _is_told(field, future, DeadlineExceededError)


@pytest.mark.field("`attach`, its cancel", can=only(SIMPLE_ACTIONS))
def test_a_busy_server_answers_another_client_too_late(field: Field) -> None:
    other = field.another_client(timeouts=SOON)
    future = field.running("busy")
    attached = other.attach(future.goal_id, timeout=30.0)
    next(iter(attached.feedback()))
    attached.cancel()
    _is_told(field, attached, DeadlineExceededError)
    assert future.outcome().status is GoalState.SUCCEEDED


@pytest.mark.field("`cancel_everything`", can=only(SIMPLE_ACTIONS))
def test_of_everything_a_busy_server_cancels_nothing(field: Field) -> None:
    future = _busy(field)
    told = field.another_client(timeouts=SOON).cancel_everything(timeout=1.0)
    assert not field.server.count("succeeded")
    assert told[future.goal_id] is CancelReport.UNKNOWN
    assert {*told.values()} == {CancelReport.UNKNOWN}
    assert not future.done()
    field.saw(TOLD)


@pytest.mark.field("`actionkit cancel`", can=only(SIMPLE_ACTIONS))
def test_the_command_cancel_says_that_a_busy_server_did_not_answer(field: Field) -> None:
    future = _busy(field)
    said = field.command("cancel", field.kind.action_name, str(future.goal_id), "--timeout", "0.5")
    assert not field.server.count("succeeded")
    assert said.code == 23, said
    field.saw(TOLD)


@pytest.mark.field("`actionkit stop`", can=only(SIMPLE_ACTIONS))
def test_the_command_stop_says_that_a_busy_server_did_not_answer(field: Field) -> None:
    _busy(field)
    said = field.command("stop", field.kind.action_name, "--timeout", "4.5")
    assert not field.server.count("succeeded")
    assert said.code == 23, said
    field.saw(TOLD)


@pytest.mark.field("`replaces=`", can=only(SIMPLE_ACTIONS))
def test_a_goal_of_a_busy_server_is_replaced_when_it_has_ended(field: Field) -> None:
    """With too little time to cancel, nothing is sent; with enough, after the earlier goal."""
    client = field.another_client(timeouts=SOON)
    first = client.call_async(field.goal("busy"))
    field.server.wait_for("executing")
    second = client.call_async(field.goal("short"), replaces=first)
    with pytest.raises(GoalNotReplacedError):
        second.result()
    assert first.outcome().cancel is CancelReport.UNKNOWN
    assert not field.server.count("succeeded")
    field.server.wait_for("succeeded")

    client = field.another_client(timeouts=PATIENT)
    third = client.call_async(field.goal("busy"))
    field.server.wait_for("executing", 2)
    fourth = client.call_async(field.goal("short"), replaces=third)
    assert fourth.outcome().ok
    assert third.outcome().status is GoalState.SUCCEEDED
    assert third.outcome().cancel is CancelReport.CONFIRMED
    field.server.wait_for("succeeded", 3)
    assert field.server.order("executing", "succeeded") == ["executing", "succeeded"] * 3
    field.saw("not sent while the first may run")


@pytest.mark.field("A second goal", can=only(SIMPLE_ACTIONS))
def test_a_busy_server_accepts_a_second_goal_later(field: Field) -> None:
    """A call that does not wait for the acceptance says that the goal may run, and it does."""
    client = field.another_client(timeouts=IMPATIENT)
    first = field.running("busy")
    second = client.call_async(field.goal("short"))
    outcome = second.outcome()
    assert not field.server.count("succeeded")
    assert isinstance(outcome.error, AcceptanceTimeoutError)
    assert outcome.cancel is CancelReport.UNKNOWN
    assert outcome.goals[0].fate.may_run
    assert first.outcome().ok
    patient = field.another_client(timeouts=PATIENT)
    assert patient.call_async(field.goal("short")).outcome().ok
    field.server.wait_for("succeeded", 3)
    until(lambda: second.known_to_run is False)
    assert field.server.order("executing", "succeeded") == ["executing", "succeeded"] * 3
    field.saw("accepted after the first")
    field.told(SECOND, "nothing until it is accepted, or `AcceptanceTimeoutError`")


@pytest.mark.field("Killed, restarted", can=only(SIMPLE_ACTIONS))
def test_a_busy_server_is_killed(field: Field) -> None:
    future = _busy(field)
    field.server.kill()
    field.server.start()
    with pytest.raises(ServerLostError):
        future.result()
    field.another_client().call(field.goal("short"), timeout=40.0)
    field.server.wait_for("succeeded")
    assert field.server.count("executing") == 2


@pytest.mark.field("`watch`, `doctor`", can=only(SIMPLE_ACTIONS))
def test_the_commands_look_at_a_busy_server(field: Field) -> None:
    _start(field, "simple", "srv_simple.py", "slow")
    future = _busy(field)
    name = field.kind.action_name
    with ThreadPoolExecutor(2) as pool:  # both, before the goal ends
        watching = pool.submit(field.command, "watch", name, "--once")
        seen = field.command("doctor", name)
        watched = watching.result()
    assert watched.code == 0, watched
    assert str(future.goal_id)[:8] in watched.out
    assert not field.server.count("succeeded")
    assert seen.code == 1, seen
    assert "busy in a callback" in seen.out
    field.saw("`doctor` says that it is busy")


@pytest.mark.field("Refused", can=only(SIMPLE_ACTIONS))
def test_with_threads_it_refuses_each_cancel(field: Field) -> None:
    """It has no callback for cancels, and rclpy's own refuses them."""
    _start(field, "simple", "srv_simple.py", "threads")
    future = field.running("busy")
    future.cancel()
    outcome = future.outcome()
    field.server.wait_for("succeeded")
    assert outcome.cancel is CancelReport.REFUSED
    assert outcome.status is GoalState.SUCCEEDED
    field.saw("yes, with several threads")


@pytest.mark.field(can=only(SIMPLE_ACTIONS))
def test_with_threads_it_mixes_up_two_goals(field: Field) -> None:
    """The end of each is written into the one that began last; rclpy aborts the other."""
    _start(field, "simple", "srv_simple.py", "threads")
    first = field.running("busy")
    second = field.client.call_async(field.goal("short"), timeout=20.0)
    assert second.outcome().ok
    assert first.outcome().status is GoalState.ABORTED
    field.server.wait_for("succeeded", 2)
    field.server.wait_for_text("assuming aborted")
    field.told(MIXED_UP, "`GoalAbortedError`, though the work is done")


# -- synchros2 -------------------------------------------------------------------------------


@pytest.mark.field(can=only(SYNCHROS2))
def test_a_goal_that_waits_for_the_first_one_is_preempted_too(field: Field) -> None:
    """The server cancels each goal when the next one comes, and executes one at a time."""
    first = field.running()
    others = []
    for name in ("long", "short"):
        others.append(field.client.call_async(field.goal(name), timeout=20.0))
        others[-1].wait_accepted()
    second, third = others
    assert third.outcome().ok
    for preempted in (first, second):
        with pytest.raises(GoalCanceledError):
            preempted.result()
    field.server.wait_for("succeeded")
    field.server.wait_for("canceled", 2)
    field.told(THIRD, "`GoalCanceledError` for the first and the second")


@pytest.mark.field(can=only(SYNCHROS2))
def test_an_exception_in_the_work_is_an_abort(field: Field) -> None:
    """The number 47 is too large for its field; then the next goal is executed."""
    _start(field, "sync_pkg", "srv_sync.py", "fast")
    with pytest.raises(GoalAbortedError):
        field.client.call({"order": 60}, timeout=20.0)
    field.server.wait_for("aborted")
    field.client.call(field.goal("short"), timeout=20.0)
    field.server.wait_for("succeeded")
    assert field.server.count("executing") == 2
    assert not field.server.count("canceled")
    field.told(EXCEPTION, "`GoalAbortedError`")


# -- Dock ------------------------------------------------------------------------------------


@pytest.mark.field("Abort", can=only(DOCK))
def test_a_preempted_goal_is_an_abort_with_its_result(field: Field) -> None:
    first = field.running()
    other = field.another_client()
    assert other.call(field.goal("short"), timeout=20.0).message == "goal executed with success"
    with pytest.raises(GoalAbortedError) as caught:
        first.result()
    field.server.wait_for("aborted")
    assert caught.value.result.message == "goal pre-empted"


@pytest.mark.field(can=only(DOCK))
def test_dock_is_stopped_by_ctrl_c(field: Field) -> None:
    """It aborts its goal when its context is shut down already, so it tells nobody."""
    future = field.running()
    field.server.signal(signal.SIGINT)
    field.server.wait_for_text("aborting")
    outcome = future.outcome()
    assert isinstance(outcome.error, ServerLostError)
    assert outcome.cancel is CancelReport.UNKNOWN
    field.told(CTRL_C, "`ServerLostError`")

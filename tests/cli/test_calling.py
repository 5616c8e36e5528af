"""The order in which a call is reported, and the signals that end it."""

from __future__ import annotations

import signal
import uuid
from types import SimpleNamespace
from typing import Any, cast

import pytest

import actionkit as ak
from actionkit import CancelReport, GoalEvent, GoalState, Outcome
from actionkit._model.values import GoalFate, GoalReport
from actionkit.cli._shared import signals as _signals
from actionkit.cli._shared.exits import Exit, exit_of
from actionkit.cli.call._calling import Calling
from actionkit.cli.call._reports import TextReport, became


def test_an_end_is_told_after_the_feedback_that_came_before_it() -> None:
    """The server's answer may be known while feedback is still on its way to be shown."""
    told: list[GoalState] = []
    report = SimpleNamespace(event=lambda event: told.append(event.state))
    calling = Calling(cast(Any, None), cast(Any, report), echo=True, progress=None)
    states = (GoalState.SENT, GoalState.ACCEPTED, GoalState.SUCCEEDED)
    events = [GoalEvent(uuid.UUID(int=1), 1, s, float(n), 0.0) for n, s in enumerate(states)]
    calling._future = cast(Any, SimpleNamespace(timeline=events))
    calling._catch_up(0.5)
    assert told == [GoalState.SENT]
    calling._catch_up(9.0)
    assert told == [GoalState.SENT, GoalState.ACCEPTED]
    calling._catch_up(9.0, ended=True)
    assert told == list(states)


def test_two_signals_of_one_press_are_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """The terminal sends Ctrl-C to all its processes, and a wrapper passes its own on."""
    first: list[Exit] = []
    left: list[tuple[Exit, str]] = []
    monkeypatch.setattr(_signals, "leave_at_once", lambda *said: left.append(said))
    before = signal.getsignal(signal.SIGINT)
    with _signals.handled(first.append, lambda: "farewell"):
        signal.raise_signal(signal.SIGINT)
        signal.raise_signal(signal.SIGINT)
        assert (first, left) == ([Exit.INTERRUPTED], [])
        monkeypatch.setattr(_signals, "_ONE_PRESS", -1.0)
        signal.raise_signal(signal.SIGTERM)
        signal.raise_signal(signal.SIGINT)
        assert (first, left) == ([Exit.INTERRUPTED], [(Exit.TERMINATED, "farewell")])
    assert signal.getsignal(signal.SIGINT) is before


def test_the_first_ctrl_c_cancels_at_once() -> None:
    """And not only when the client is closed, after the time for a cancel."""
    asked: list[str] = []
    report = SimpleNamespace(interrupted=lambda code: asked.append(f"told of {code}"))
    client = SimpleNamespace(timeouts=SimpleNamespace(cancel=2.0))
    calling = Calling(cast(Any, client), cast(Any, report), echo=False, progress=None)
    future = SimpleNamespace(done=lambda: False, cancel=lambda: asked.append("cancel"), timeline=())
    calling._future = cast(Any, future)
    calling._interrupt(Exit.INTERRUPTED)
    assert asked == ["cancel", "told of 130"]


def test_a_signal_before_the_goal_is_sent_keeps_it_back(capsys: pytest.CaptureFixture[str]) -> None:
    calling: Calling
    report = SimpleNamespace(begin=lambda: calling._interrupt_soon(Exit.TERMINATED))
    calling = Calling(cast(Any, None), cast(Any, report), echo=False, progress=None)
    assert calling._run(lambda _: pytest.fail("it was sent")) is Exit.TERMINATED
    assert capsys.readouterr().err == "Nothing was sent.\n"


@pytest.mark.parametrize(
    ("error", "cancel", "code"),
    [
        (None, None, Exit.OK),
        (None, CancelReport.CONFIRMED, Exit.OK),
        (None, CancelReport.UNKNOWN, Exit.CANCEL_UNKNOWN),
        (ak.DeadlineExceededError, CancelReport.CONFIRMED, Exit.TIMED_OUT),
        (ak.DeadlineExceededError, CancelReport.REFUSED, Exit.CANCEL_REFUSED),
        (ak.DeadlineExceededError, CancelReport.UNKNOWN, Exit.CANCEL_UNKNOWN),
        (ak.FeedbackStalledError, CancelReport.REFUSED, Exit.CANCEL_REFUSED),
        (ak.GoalAbortedError, CancelReport.UNKNOWN, Exit.CANCEL_UNKNOWN),
        # Their own codes say that the goal may run.
        (ak.ServerLostError, CancelReport.UNKNOWN, Exit.SERVER_LOST),
        (ak.AcceptanceTimeoutError, CancelReport.UNKNOWN, Exit.NO_ANSWER),
    ],
)
@pytest.mark.every
def test_a_goal_that_may_run_decides_about_the_exit_code(
    error: type[ak.ActionKitError] | None, cancel: CancelReport | None, code: Exit
) -> None:
    raised = None if error is None else error("for the test")
    goal = uuid.UUID(int=1)
    told = Outcome(GoalState.SENT, None, raised, 1, cast(Any, ()), goal, cancel)
    assert exit_of(told) is code


def test_a_success_names_the_goals_that_may_still_run(capsys: pytest.CaptureFixture[str]) -> None:
    """As of two servers on one name, or of an earlier attempt."""
    ids = uuid.UUID(int=1), uuid.UUID(int=2)
    goals = (GoalReport(ids[0], GoalFate.LOST), GoalReport(ids[1], GoalFate.ENDED))
    outcome = Outcome(
        GoalState.SUCCEEDED, None, None, 2, cast(Any, ()), ids[1], CancelReport.UNKNOWN, goals=goals
    )
    left = f"Goal {ids[0]} of this call MAY STILL BE RUNNING: the server is gone, or silent."
    assert exit_of(outcome) == Exit.CANCEL_UNKNOWN
    TextReport(None).finished(outcome, exit_of(outcome))
    assert capsys.readouterr().err == f"Warning: {left}\n"
    ended = "Too late to cancel: the goal had ended as SUCCEEDED."
    assert became(outcome) == f"{ended} {left}"


def test_a_cancel_that_takes_longer_is_not_told_as_one_without_an_answer() -> None:
    goal = uuid.UUID(int=1)
    events = [GoalEvent(goal, 1, GoalState.CANCELING, 1.0, 1.0)]
    goals = (GoalReport(goal, GoalFate.RUNNING),)
    for timeline, told in (([], "as no answer came."), (events, "The server is cancelling it")):
        outcome = Outcome(
            GoalState.TIMED_OUT,
            None,
            RuntimeError(),
            1,
            cast(Any, timeline),
            goal,
            CancelReport.UNKNOWN,
            goals=goals,
        )
        assert told in became(outcome)
        assert became(outcome).count("MAY STILL BE RUNNING") == 1

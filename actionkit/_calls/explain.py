"""Turns the ending of a call into the error that tells its user what happened (contract C3.2).

Each text is one sentence of what happened, to which action, after how long, and one of what
to do about it.
"""

from __future__ import annotations

import concurrent.futures
import uuid
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from actionkit._calls.graph_snapshot import GraphSnapshot, seen_instead
from actionkit._goal.effects import End, Ending
from actionkit._model import errors
from actionkit._model.settings import Timeouts
from actionkit._model.values import CancelReport, GoalState, Timeline, Verdict
from actionkit._threads.function_runner import LONGEST_ANSWER


@dataclass(frozen=True)
class Story:
    """What an error needs to know of its call."""

    action_name: str
    type_name: str
    goal_id: uuid.UUID
    attempts: int
    timeline: Timeline
    elapsed: float
    timeout: float | None
    timeouts: Timeouts
    surroundings: Callable[[], GraphSnapshot]


def explain(ending: Ending, story: Story) -> BaseException | None:
    """Return the error for an ending, or `None` for a success."""
    if ending.end is End.SUCCEEDED:
        return None
    judged_transient = ending.end is End.JUDGED and ending.info is Verdict.TRANSIENT
    if ending.strategy is not None or (judged_transient and ending.note):
        return _exhausted(ending, story)
    if ending.end is End.CANCELLED_BY_CALLER:
        return concurrent.futures.CancelledError(
            f"goal {story.goal_id} of action {story.action_name!r} was cancelled by its caller"
            f" after {story.elapsed:.1f} s"
        )
    cls, text = _TEXTS[ending.end]
    if judged_transient:
        cls = errors.TransientError
    note = f" It was not tried again: {ending.note}." if ending.note else ""
    if ending.judge is not None and ending.end is not End.UNJUDGED:
        note += f" It was not tried again, because {ending.judge.problem}."
    error = cls(
        text(ending, story) + note,
        **_common(story),
    )
    error.cancel = ending.cancel
    _add_facts(error, ending, story)
    return error


def _exhausted(ending: Ending, story: Story) -> BaseException:
    """Return the error for retries that ended where the last failure does not say why."""
    last = explain(replace(ending, strategy=None, note=""), story)
    fault = ending.strategy
    reason = ending.note if fault is None else fault.problem
    error = errors.RetriesExhaustedError(f"{last} The retries ended: {reason}.", **_common(story))
    error.result, error.cancel = ending.result, ending.cancel
    error.__cause__ = last if fault is None or fault.cause is None else fault.cause
    return error


def _common(story: Story) -> dict[str, Any]:
    return {
        "action_name": story.action_name,
        "goal_id": story.goal_id,
        "attempts": story.attempts,
        "timeline": story.timeline,
        "elapsed": story.elapsed,
    }


def _add_facts(error: errors.ActionKitError, ending: Ending, story: Story) -> None:
    if ending.end in (End.ABORTED, End.CANCELED_BY_OTHER, End.JUDGED, End.UNJUDGED):
        error.result = ending.result
    if isinstance(error, errors.DeadlineExceededError):
        error.phase = ending.phase
        error.late_result = ending.result
    elif isinstance(error, errors.ActionTypeMismatchError):
        error.expected = story.type_name
        error.served = ending.info
    elif isinstance(error, errors.ResultLostError):
        error.status = ending.info
    elif isinstance(error, errors.InvalidGoalError):
        error.field = getattr(ending.info, "path", "")
    if isinstance(ending.info, BaseException):
        error.__cause__ = ending.info
    if ending.end is End.UNJUDGED and ending.judge is not None:
        error.__cause__ = ending.judge.cause


def _what(story: Story) -> str:
    return f"Goal {story.goal_id} of action {story.action_name!r}"


def _became(ending: Ending, story: Story) -> str:
    """Say what became of a goal that was given up on."""
    if ending.cancel is CancelReport.CONFIRMED:
        if ending.status is GoalState.SUCCEEDED:
            return " It succeeded while it was being cancelled: its result is in `late_result`."
        return " It was cancelled on the server, which confirmed that it runs no more."
    if ending.cancel is CancelReport.REFUSED:
        return " The server refused to cancel it: IT IS STILL RUNNING."
    if ending.cancel is CancelReport.UNKNOWN:
        return (
            f" The server did not confirm its cancellation within {story.timeouts.cancel:g} s:"
            " IT MAY STILL BE RUNNING."
        )
    return ""


def _seen_instead(story: Story) -> str:
    return seen_instead(story.surroundings(), story.action_name, story.type_name)


def _no_server(ending: Ending, story: Story) -> str:
    return (
        f"No server for action {story.action_name!r} ({story.type_name}) was ready within"
        f" {story.timeouts.server:g} s, so nothing was sent. {_seen_instead(story)}"
    )


def _type_mismatch(ending: Ending, story: Story) -> str:
    # An earlier attempt may have met a server of the right type.
    nothing = "nothing was sent" if story.attempts < 2 else f"attempt {story.attempts} sent nothing"
    return (
        f"Action {story.action_name!r} is served as {', '.join(ending.info)}, but this client"
        f" was made for {story.type_name}; {nothing}. Use the served type, or the name of"
        " a server of your type."
    )


def _invalid(ending: Ending, story: Story) -> str:
    return (
        f"The goal for action {story.action_name!r} is not valid, nothing was sent: {ending.info}"
    )


def _no_acceptance(ending: Ending, story: Story) -> str:
    return (
        f"{_what(story)} was neither accepted nor rejected within {story.timeouts.accept:g} s."
        f"{_became(ending, story)} The server is busy in a callback, or deaf: look at its log,"
        " or allow more with Timeouts(accept=...)."
    )


def _lost(ending: Ending, story: Story) -> str:
    if isinstance(ending.info, BaseException):
        return (
            f"The communication thread of ActionKit died in this process ({ending.info!r}), so"
            f" goal {story.goal_id} of action {story.action_name!r} cannot be followed any more:"
            " IT MAY STILL BE RUNNING. Please report it; the next call starts a new thread."
        )
    if ending.status is GoalState.SENDING:
        return f"{_what(story)} was never sent, because {ending.info}. Call again."
    return (
        f"The server of action {story.action_name!r} was lost {story.elapsed:.1f} s into the"
        f" call, with goal {story.goal_id} in flight ({ending.info}). Look for a crash in the"
        " server's log; what the goal did until then is not known."
    )


def _stalled(ending: Ending, story: Story) -> str:
    return (
        f"{_what(story)} sent no feedback for {story.timeouts.feedback:g} s."
        f"{_became(ending, story)} Look at what the server waits for, or allow a longer silence"
        " with Timeouts(feedback=...)."
    )


def _rejected(ending: Ending, story: Story) -> str:
    return (
        f"{_what(story)} was rejected by the server after {story.elapsed:.1f} s; it never ran."
        " The action protocol carries no reason: look at the server's log."
    )


def _aborted(ending: Ending, story: Story) -> str:
    return (
        f"{_what(story)} was aborted by the server after {story.elapsed:.1f} s."
        f"{_told_by_result(ending.result)}"
        " What the server sent with it is in `error.result`; its log may say more."
    )


def _told_by_result(result: Any) -> str:
    """Quote the two fields in which servers by habit say why."""
    told = []
    for name in ("error_code", "error_msg"):
        value = getattr(result, name, None)
        if value not in (None, ""):
            told.append(f"{name}={value!r}")
    return f" It says {', '.join(told)}." if told else ""


def _canceled(ending: Ending, story: Story) -> str:
    return (
        f"{_what(story)} was cancelled after {story.elapsed:.1f} s, and not by this client."
        " Another client, an operator or the server itself did so; it is not tried again."
    )


def _result_lost(ending: Ending, story: Story) -> str:
    ended = f"ended as {ending.info}" if isinstance(ending.info, GoalState) else "ended"
    return (
        f"{_what(story)} {ended}, but its result cannot be had after {story.elapsed:.1f} s:"
        f" {ending.why}. Raise the server's result_timeout, look in its log for an error after the"
        " goal's end, or allow the result more time with timeout= or Timeouts(result=...)."
    )


def _deadline(ending: Ending, story: Story) -> str:
    if ending.phase == "cancel" and ending.cancel is CancelReport.CONFIRMED:
        return (
            f"{_what(story)} was cancelled by its caller and has ended on the server, but its"
            f" result did not come within {story.timeouts.cancel:g} s. It runs no more."
        )
    if ending.phase == "cancel":
        return (
            f"{_what(story)} was cancelled by its caller, but the server did not confirm that"
            f" within {story.timeouts.cancel:g} s: IT MAY STILL BE RUNNING. It is cancelled as"
            " soon as the server answers; stop it by other means if that cannot wait."
        )
    if ending.phase == "server" and ending.cancel is CancelReport.NOT_NEEDED:
        return (
            f"No server for action {story.action_name!r} ({story.type_name}) was ready before"
            f" the time given to the call, {story.timeout:g} s, ran out waiting for a server;"
            f" nothing was sent. {_seen_instead(story)}"
        )
    waited = {
        "server": "waiting for a server that could try again",
        "accept": "waiting for acceptance",
        "execute": "before the goal ended",
        "pause": "in the pause before another attempt",
    }[ending.phase]
    return (
        f"{_what(story)} did not finish: the time given to the call, {story.timeout:g} s, ran out"
        f" {waited}.{_became(ending, story)} Give it more time, or find out what the server"
        " waits for."
    )


def _judged(ending: Ending, story: Story) -> str:
    return (
        f"{_what(story)} succeeded on the server after {story.elapsed:.1f} s, but by `classify=`"
        f" its result is a failure ({ending.info}).{_told_by_result(ending.result)} It is in"
        " `error.result`."
    )


def _unjudged(ending: Ending, story: Story) -> str:
    assert ending.judge is not None
    happened = f"{story.elapsed:.1f} s into the call {ending.judge.problem}"
    if ending.judge.impossible:
        became = "rejected" if ending.status is GoalState.REJECTED else "aborted"
        return (
            f"{_what(story)} was {became} by the server, and {happened}. A goal that failed without"
            " a result is never a success: let that function return None for it, or another"
            " Verdict."
        )
    return (
        f"{_what(story)} succeeded on the server, but {happened}; so the call does not count as a"
        " success. The result is in `error.result`. Correct that function: it has to return a"
        " Verdict, or None where it has no opinion, in the time that is left to the call, and"
        f" within {LONGEST_ANSWER:g} s."
    )


def _closed(ending: Ending, story: Story) -> str:
    if ending.cancel is CancelReport.UNKNOWN and ending.phase == "":
        became = " It was left to run on the server, or may still be running."
    else:
        became = _became(ending, story)
    return (
        f"{_what(story)} was in flight when its client was closed.{became} Wait for the result"
        " before close(), or leave the `with` block later."
    )


_TEXTS: dict[End, tuple[type[errors.ActionKitError], Callable[[Ending, Story], str]]] = {
    End.NO_SERVER: (errors.ServerUnavailableError, _no_server),
    End.TYPE_MISMATCH: (errors.ActionTypeMismatchError, _type_mismatch),
    End.INVALID: (errors.InvalidGoalError, _invalid),
    End.NO_ACCEPTANCE: (errors.AcceptanceTimeoutError, _no_acceptance),
    End.REJECTED: (errors.GoalRejectedError, _rejected),
    End.ABORTED: (errors.GoalAbortedError, _aborted),
    End.CANCELED_BY_OTHER: (errors.GoalCanceledError, _canceled),
    End.LOST: (errors.ServerLostError, _lost),
    End.RESULT_LOST: (errors.ResultLostError, _result_lost),
    End.STALLED: (errors.FeedbackStalledError, _stalled),
    End.DEADLINE: (errors.DeadlineExceededError, _deadline),
    End.JUDGED: (errors.PermanentError, _judged),
    End.UNJUDGED: (errors.ClassifyError, _unjudged),
    End.CLOSED: (errors.ClientClosedError, _closed),
}

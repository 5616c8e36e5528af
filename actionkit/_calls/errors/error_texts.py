"""The text of the error for each way in which a call can end, and the error's class.

Each text has one sentence about what happened, to which action and after how long, and one about
what to do.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from actionkit._calls.errors.error_context import ErrorContext
from actionkit._calls.errors.graph_snapshot import DISCOVERY, no_data, seen_instead
from actionkit._calls.errors.still_running import (
    GONE,
    cancel_sentence,
    is_being_cancelled,
    is_left,
    unconfirmed,
    why_it_may_run,
)
from actionkit._goal.effects import End, Ending
from actionkit._model import errors
from actionkit._model.printable import full_stop
from actionkit._model.values import CancelReport, GoalState
from actionkit._threads.function_runner import LONGEST_ANSWER

CLIENT_CLOSED = "its client was closed"
"""Why a call ends that did not end by itself. It is another reason if ROS was shut down."""
ENDING = "the program was told to end"
_MORE_TIME = (
    f" A server that runs can take {DISCOVERY:g} s to be seen: if yours does, allow more time"
    " with timeout= and Timeouts(server=...)."
)


def _after(call: ErrorContext) -> str:
    """Return after how many seconds the goal's last news came; the call may have ended later."""
    news = [
        event.monotonic
        for event in call.timeline
        if event.goal_id == call.goal_id and event.state is not GoalState.RETRYING
    ]
    seconds = news[-1] - call.timeline[0].monotonic if news else call.elapsed
    return f"{seconds:.1f} s"


def _what(call: ErrorContext) -> str:
    return f"Goal {call.goal_id} of action {call.action_name!r}"


def _no_server(ending: Ending, call: ErrorContext) -> str:
    graph = call.surroundings()
    looked = f"after {call.elapsed:.1f} s of looking, so nothing was sent"
    if call.timeout == 0:
        looked = "and timeout=0 leaves no time to look for one; nothing was sent"
    patience = ""
    if call.elapsed < DISCOVERY and graph.actions is not None:
        patience = "" if call.action_name in graph.actions else _MORE_TIME
    return (
        f"No server for action {call.action_name!r} ({call.type_name}) is ready {looked}."
        f" {seen_instead(graph, call.action_name, call.type_name)}{patience}"
    )


def _type_mismatch(ending: Ending, call: ErrorContext) -> str:
    # An earlier attempt may have met a server of the right type.
    nothing = "nothing was sent" if call.attempts < 2 else f"attempt {call.attempts} sent nothing"
    versions = [served for served in ending.served if served.startswith(f"{call.type_name} (")]
    if versions:
        return (
            f"Action {call.action_name!r} is served with another version of the type:"
            f" {', '.join(versions)}; {nothing}. Build both sides from the same .action file."
        )
    return (
        f"Action {call.action_name!r} is served as {', '.join(ending.served)}, but this client"
        f" was made for {call.type_name}; {nothing}. Use the served type, or the name of"
        " a server of your type."
    )


def _invalid(ending: Ending, call: ErrorContext) -> str:
    return invalid_text(call.action_name, ending.error)


def invalid_text(action_name: str, problem: BaseException | None) -> str:
    """Return the text for a goal that is not valid."""
    said = full_stop(str(problem))
    return f"The goal for action {action_name!r} is not valid, nothing was sent: {said}"


def _not_replacing(ending: Ending, call: ErrorContext) -> str:
    kept = " and ".join(
        f"goal {goal.goal_id} MAY STILL BE RUNNING ({why_it_may_run(goal)})"
        for goal in ending.earlier
    )
    return (
        f"{_what(call)} was not sent. It was to replace an earlier goal, and"
        f" {kept or 'the call of that one is not over'}, {call.timeouts.cancel:g} s after it was"
        " cancelled. Stop that by other means, or allow more time with Timeouts(cancel=...). If the"
        " server itself stops a goal when a new one comes, use preempt=True."
    )


def _unknown(_: Ending, call: ErrorContext) -> str:
    if call.key is not None:
        return (
            f"No server of action {call.action_name!r} knows goal {call.goal_id}, which an earlier"
            f" call with key {call.key!r} has sent. So it does not run there, but it may have"
            f" finished. Find out whether it has. `ledger.forget({call.key!r})` lets it be sent"
            " again."
        )
    return (
        f"No server of action {call.action_name!r} knows goal {call.goal_id}. The id may be wrong"
        " or of another action, the server may have been restarted, it may not have accepted the"
        " goal yet, or the goal ended longer ago than the server remembers (its result_timeout)."
        " `actionkit watch` shows the goals there."
    )


def _no_acceptance(ending: Ending, call: ErrorContext) -> str:
    reason = (
        "The server is busy in a callback, or not responding: look at its log, or allow more with"
        " Timeouts(accept=...)."
    )
    if call.surroundings().no_data:
        reason = no_data(call.action_name)
    if call.attached:
        return (
            f"No server of action {call.action_name!r} answered within {call.timeouts.accept:g} s"
            f" whether it has goal {call.goal_id}.{cancel_sentence(ending, call)} {reason}"
        )
    return (
        f"{_what(call)} was neither accepted nor rejected within {call.timeouts.accept:g} s."
        f"{cancel_sentence(ending, call)} {reason}"
    )


def _lost(ending: Ending, call: ErrorContext) -> str:
    if ending.error is not None:
        left = (
            f", so goal {call.goal_id} of action {call.action_name!r} cannot be followed any more:"
            " IT MAY STILL BE RUNNING"
        )
        return (
            f"The communication thread of ActionKit died in this process ({ending.error!r})"
            f"{left if ending.may_run else ''}. Please report it, and make a new client."
        )
    return (
        f"The server of action {call.action_name!r} was lost {_after(call)} into the"
        f" call, with goal {call.goal_id} in flight ({ending.lost_because}). Look for a crash in"
        " the server's log, for a second server of its name, and at the network; what the goal did"
        " until then is not known."
    )


def _stalled(ending: Ending, call: ErrorContext) -> str:
    return (
        f"{_what(call)} sent no feedback for {call.timeouts.feedback:g} s."
        f"{cancel_sentence(ending, call)} Look at what the server waits for, or allow a longer"
        " silence with Timeouts(feedback=...)."
    )


def _rejected(ending: Ending, call: ErrorContext) -> str:
    never = "another server on the same name may run it" if ending.elsewhere else "it never ran"
    return (
        f"{_what(call)} was rejected by the server after {_after(call)}; {never}."
        " The action protocol carries no reason: look at the server's log."
    )


def _aborted(ending: Ending, call: ErrorContext) -> str:
    return (
        f"{_what(call)} was aborted by the server after {_after(call)}."
        f"{_told_by_result(ending.result)}"
        " What the server sent with it is in `error.result`; its log may say more."
    )


def _told_by_result(result: Any) -> str:
    """Quote the two fields in which servers often say why."""
    said = []
    for name in ("error_code", "error_msg"):
        value = getattr(result, name, None)
        if value not in (None, "", 0):  # 0 is the default, and usually means no error
            said.append(f"{name}={value!r}")
    return f" It says {', '.join(said)}." if said else ""


def _canceled(ending: Ending, call: ErrorContext) -> str:
    if ending.lost_because:
        return f"{_what(call)} was cancelled after {_after(call)}: {ending.lost_because}."
    return (
        f"{_what(call)} was cancelled after {_after(call)}, and not by this client."
        " Another client, an operator or the server itself did so; it is not tried again."
    )


def _result_lost(ending: Ending, call: ErrorContext) -> str:
    ended = "ended" if ending.ended_as is None else f"ended as {ending.ended_as}"
    return (
        f"{_what(call)} {ended}, but its result cannot be had after {call.elapsed:.1f} s:"
        f" {ending.lost_because}. Look in the server's log for a restart, or an error after the"
        " goal's end, raise the server's result_timeout, or allow the result more time with"
        " timeout= or Timeouts(result=...)."
    )


def _deadline(ending: Ending, call: ErrorContext) -> str:
    if ending.phase == "cancel" and ending.own_cancel is CancelReport.CONFIRMED:
        became = f"was cancelled by its caller and ended as {ending.ended_as}"
        if ending.ended_first:
            became = f"had ended as {ending.ended_as} when its caller cancelled it"
        return (
            f"{_what(call)} {became}; its result did not come within {call.timeouts.cancel:g} s."
            " It runs no more."
        )
    if ending.ended_first and ending.result is None:
        return (
            f"{_what(call)} ended as {ending.ended_as}; its result did not come within"
            f" {call.timeout:g} s, the time given to the call. It runs no more. Look in the"
            " server's log for an error after the goal's end, or give the call more time."
        )
    if ending.phase == "cancel" and call.attached and is_left(ending, call):
        return (
            f"{_what(call)} was to be cancelled, and no server was in sight within"
            f" {call.timeouts.cancel:g} s: IT MAY STILL BE RUNNING, and is not cancelled later."
            " Cancel it again when its server is there, or stop it by other means."
        )
    if ending.phase == "cancel":
        remedy = (
            "Allow more time, or stop it by other means."
            if is_being_cancelled(call)
            else "While this client is open, it is cancelled as soon as the server answers; stop it"
            " by other means if that cannot wait."
        )
        gone = ending.lost_because and not ending.elsewhere
        return (
            f"{_what(call)} was cancelled by its caller, but"
            f" {GONE if gone else unconfirmed(ending, call)}: IT MAY STILL"
            f" BE RUNNING. {remedy}"
        )
    if ending.phase == "server" and call.attempts == 1:
        return (
            f"{_what(call)} was not sent, though a server is ready: the time given to the call,"
            f" {call.timeout:g} s, ran out first. Give it more time."
        )
    waited = {
        "server": "waiting for a server that could try again",
        "accept": "waiting for acceptance",
        "execute": "before the goal ended",
        "pause": "in the pause before another attempt",
        "replace": "waiting for the goal that it replaces to stop",
    }[ending.phase]
    return (
        f"{_what(call)} did not finish: the time given to the call, {call.timeout:g} s, ran out"
        f" {waited}.{cancel_sentence(ending, call)} Give it more time, or find out what the server"
        " waits for."
    )


def _rejected_by_classifier(ending: Ending, call: ErrorContext) -> str:
    return (
        f"{_what(call)} succeeded on the server after {_after(call)}, but by `classify=`"
        f" its result is a failure ({ending.verdict}).{_told_by_result(ending.result)} It is in"
        " `error.result`."
    )


def _classifier_failed(ending: Ending, call: ErrorContext) -> str:
    assert ending.classifier_fault is not None
    problem = full_stop(ending.classifier_fault.problem)
    happened = f"{call.elapsed:.1f} s into the call {problem}"
    if ending.classifier_fault.impossible:
        became = str(ending.status).lower()
        return (
            f"{_what(call)} was {became} by the server, and {happened} What was rejected or"
            " canceled, or failed without a result, is never a success: let that function return"
            " None for it, or another Verdict."
        )
    remedy = (
        "Correct that function: it has to return a Verdict, or None where it has no opinion, in"
        f" the time that is left to the call, and within {LONGEST_ANSWER:g} s."
    )
    if not ending.classifier_fault.asked:
        remedy = "Start fewer threads in this program, or allow more (see `ulimit -u`)."
    return (
        f"{_what(call)} succeeded on the server, but {happened} So the call does not count as a"
        f" success. The result is in `error.result`. {remedy}"
    )


def _closed(ending: Ending, call: ErrorContext) -> str:
    because = ending.lost_because or CLIENT_CLOSED
    closed = because == CLIENT_CLOSED
    remedy = "close(), or leave the `with` block later" if closed else "that"
    wait = f"Wait for the result before {remedy}."
    if ending.status is GoalState.SENDING and call.attached:
        return f"{_what(call)} was not followed: {because} first. {wait}"
    if ending.status is GoalState.SENDING:
        return f"{_what(call)} was not sent: {because} first. {wait}"
    if ending.own_cancel is CancelReport.NOT_NEEDED:  # between two attempts
        return (
            f"{_what(call)} ran no more ({ending.status}), and was not tried again, because"
            f" {because}. {wait}"
        )
    return f"{_what(call)} was in flight when {because}.{cancel_sentence(ending, call)} {wait}"


TEXTS: dict[End, tuple[type[errors.ActionKitError], Callable[[Ending, ErrorContext], str]]] = {
    End.NO_SERVER: (errors.ServerUnavailableError, _no_server),
    End.TYPE_MISMATCH: (errors.ActionTypeMismatchError, _type_mismatch),
    End.INVALID: (errors.InvalidGoalError, _invalid),
    End.UNKNOWN: (errors.GoalUnknownError, _unknown),
    End.NOT_REPLACING: (errors.GoalNotReplacedError, _not_replacing),
    End.NO_ACCEPTANCE: (errors.AcceptanceTimeoutError, _no_acceptance),
    End.REJECTED: (errors.GoalRejectedError, _rejected),
    End.ABORTED: (errors.GoalAbortedError, _aborted),
    End.CANCELED_BY_OTHER: (errors.GoalCanceledError, _canceled),
    End.LOST: (errors.ServerLostError, _lost),
    End.RESULT_LOST: (errors.ResultLostError, _result_lost),
    End.STALLED: (errors.FeedbackStalledError, _stalled),
    End.DEADLINE: (errors.DeadlineExceededError, _deadline),
    End.REJECTED_BY_CLASSIFIER: (errors.PermanentError, _rejected_by_classifier),
    End.CLASSIFIER_FAILED: (errors.ClassifyError, _classifier_failed),
    End.CLOSED: (errors.ClientClosedError, _closed),
}

"""Ends the calls of clients and waits for that: each wait is limited, and Ctrl-C ends it."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, TypeAlias

from actionkit._calls.futures.future import GoalFuture
from actionkit._calls.futures.goals_left import LINGER, warn_of_goals_left
from actionkit._calls.ledger import chosen as ledgers
from actionkit._calls.sending.last_request import LastRequest
from actionkit._model.settings import LONGEST_GRACE
from actionkit._threads.in_hand import patience
from actionkit._threads.waiting import Flag

if TYPE_CHECKING:
    from actionkit._calls.sending.call import Call
    from actionkit._calls.sending.session import Session

_Awaited: TypeAlias = GoalFuture[Any, Any] | LastRequest
MARGIN = 0.5
"""Seconds that closing may take in addition to the wait for cancellations: the communication thread
ends the calls in milliseconds, but a busy machine is slower."""
OBSERVERS_TIMEOUT = 1.0
"""Seconds that closing, and the interpreter's exit, wait for slow observers: enough to write a few
thousand lines to a file, but so short that a blocked observer does not look like a hang."""
FREEING_TIMEOUT = 5.0
"""Seconds that freeing the entities may take; on an idle machine it takes milliseconds."""


def close(session: Session) -> None:
    """End every call by the policy `on_close`, and free everything that no goal needs."""
    if session.inherited:
        return
    try:
        end_calls([session])
        warn_of_goals_left(
            session.take_untold(), None if session.connection.freed.is_set() else LINGER
        )
        if not session.was_interrupted:
            session.callbacks.dues.finish(time.monotonic() + patience(session.cancel_grace))
    finally:
        session.callbacks.dues.end()
        if session.ledger is not None:
            ledgers.flush()
    session.dispatcher.flush(time.monotonic() + OBSERVERS_TIMEOUT)


def end_interrupted(session: Session, call: Call, error: BaseException) -> None:
    """Cancel a blocking call, wait for at most `Timeouts.cancel`, and tell what may still run.

    `error` is Ctrl-C, or what a signal handler of the user's raised. A second Ctrl-C ends the wait.
    """
    future = call.future
    call.request_cancel(urgent=True)
    try:
        if not session.was_interrupted:
            _await_ends([session], [future], session.cancel_grace)
    except BaseException as second:
        future._tell_of_goals_left(second)
        raise
    future._tell_of_goals_left(error)


def end_calls(sessions: Sequence[Session], others: Sequence[GoalFuture[Any, Any]] = ()) -> float:
    """End every call by the policies `on_close`, and free everything that no goal needs.

    Also wait for the futures of `others`, which are being cancelled. Return the seconds that it
    waited for each confirmation of a cancellation.
    """
    hurry = any(session.was_interrupted for session in sessions)
    graces = [*(s.cancel_grace for s in sessions), *(o._call.cancel_grace for o in others)]
    grace = 0.0 if hurry or not graces else max(graces) + MARGIN
    for session in sessions:
        session.close_calls()
    try:
        last_requests = [session.last_request for session in sessions]
        _await_ends(sessions, [*_futures(sessions), *others, *last_requests], grace)
        for session in sessions:
            session.end_grace()
        await_ends(_futures(sessions), MARGIN)
    finally:
        _release(sessions)
    return grace


def _futures(sessions: Sequence[Session]) -> list[GoalFuture[Any, Any]]:
    return [future for session in sessions for future in session.futures]


def _await_ends(sessions: Sequence[Session], awaited: Sequence[_Awaited], grace: float) -> None:
    try:
        await_ends(awaited, grace)
    except KeyboardInterrupt:
        for session in sessions:
            session.interrupted_at = time.monotonic()
        raise


def await_ends(awaited: Sequence[_Awaited], grace: float) -> None:
    """Wait for calls to end, as long as at least one ends within each `grace` seconds."""
    latest = time.monotonic() + grace + LONGEST_GRACE
    before = len(awaited) + 1
    while awaited and (calls := _count_calls(awaited)) < before and time.monotonic() < latest:
        before = calls
        until = time.monotonic() + grace
        if all(each._wait_until_over(until - time.monotonic()) for each in awaited):
            return
        awaited = [each for each in awaited if not each.done()]


def _count_calls(awaited: Sequence[_Awaited]) -> int:
    return sum(isinstance(each, GoalFuture) for each in awaited)


def _release(sessions: Sequence[Session]) -> None:
    """Free everything that no goal needs, and wait for that."""
    until = time.monotonic() + FREEING_TIMEOUT
    for session in sessions:
        session.release()
    for session in sessions:
        released = Flag()
        session.call_soon(released.set)
        released.wait(max(0.0, until - time.monotonic()))
        if session.connection.freed.is_set():
            session.connection.runtime.join_if_stopping(max(0.0, until - time.monotonic()))

"""Handles all clients of a process: at its exit, at a signal, and after a fork."""

from __future__ import annotations

import atexit
import os
import sys
import time
import uuid
from collections.abc import Callable
from functools import cache, partial

from actionkit._calls.ending.closing import FREEING_TIMEOUT, OBSERVERS_TIMEOUT, end_calls
from actionkit._calls.futures.goals_left import warn_of_goals_left
from actionkit._calls.ledger import chosen as ledgers
from actionkit._calls.on_signal import signals
from actionkit._calls.sending.session import Session, open_sessions
from actionkit._model.settings import LONGEST_GRACE
from actionkit._observers import delivery
from actionkit._ros.communication import runtimes
from actionkit._threads import diagnostics as _diagnostics
from actionkit._threads import in_hand as _in_hand
from actionkit._threads.waiting import Flag

_LOOK = 0.02
"""Seconds between two checks whether goals still run, while a process that was told to end waits:
too short to notice, but long enough not to keep a processor busy."""
_SETTLING = 0.5
"""Seconds that the communication threads get for what they do at the moment: it takes far less."""
_BEFORE_OTHERS = 1000
"""An exit priority above those of `multiprocessing` itself, which are 100 or less."""
_inherited: list[Session] = []
"""The sessions of the parent process, kept for ever: freeing them here would break the parent's."""


def close_all() -> None:
    """End everything at the interpreter's exit, in limited time and silently (C1.10).

    It warns only of goals that may still be running and of callbacks that did not finish. Ctrl-C
    ends the waits, but everything is freed even then.
    """
    sessions = list(open_sessions)
    hurry = any(session.was_interrupted for session in sessions)
    hurry = _is_interrupted(partial(_close_sessions, sessions)) or hurry
    if _is_interrupted(partial(_free, sessions)):
        _is_interrupted(partial(_free, sessions, at_once=True))  # that takes only milliseconds
    if not hurry:
        grace = max((session.cancel_grace for session in sessions), default=0.0)
        until = time.monotonic() + _in_hand.patience(grace)
        _is_interrupted(partial(_in_hand.finish_all, until, _in_hand.CALLBACKS))
    _is_interrupted(ledgers.flush)
    observers_until = time.monotonic() + OBSERVERS_TIMEOUT
    _is_interrupted(partial(delivery.flush_all, observers_until))
    _in_hand.end_all()  # after this, observers get nothing either
    _is_interrupted(partial(_diagnostics.flush, time.monotonic() + OBSERVERS_TIMEOUT))


def _is_interrupted(step: Callable[[], object]) -> bool:
    """Run a step of the exit; return whether Ctrl-C interrupted it."""
    try:
        step()
    except KeyboardInterrupt:
        return True
    return False


def _close_sessions(sessions: list[Session]) -> None:
    began = time.monotonic()
    _await_freed(sessions, began, end_calls(sessions))


def _await_freed(sessions: list[Session], began: float, grace: float) -> None:
    """Wait until everything is freed, as long as servers go on confirming cancellations.

    If a caller has already waited for a goal's cancellation without success, do not wait again.
    """
    while True:
        confirmed_at = max((session.confirmed_at for session in sessions), default=began)
        given_up_at = max((session.given_up_at for session in sessions), default=began)
        until = max(given_up_at, min(confirmed_at, began + LONGEST_GRACE)) + grace
        if time.monotonic() >= until or all(s.await_freed(until) for s in sessions):
            return


def _free(sessions: list[Session], *, at_once: bool = False) -> None:
    """Free everything: the middleware's own exit handlers abort if anything is left.

    `at_once` is the same as for `runtimes.join_ending`.
    """
    for session in sessions:
        session.close_calls()  # again: Ctrl-C may have interrupted the first time
    warn_of_goals_left(_give_up_waiting(sessions))
    for session in sessions:
        session.free()
    until = time.monotonic() + FREEING_TIMEOUT
    for session in sessions:
        session.await_freed(until)
    # These exit handlers also crash if a thread still uses the middleware.
    runtimes.end_all(FREEING_TIMEOUT, at_once=at_once)


def cancel_goals(hurry: Callable[[], bool]) -> None:
    """Cancel all goals, with any `on_close`; wait for that, and warn of goals that may run.

    A signal handler may call this at any moment. `hurry` returns whether to stop waiting, because
    a human wants that.
    """
    sessions = list(open_sessions)
    grace = max((session.cancel_grace for session in sessions), default=0.0)
    began = time.monotonic()
    try:
        for session in sessions:
            session.end_calls()
        while any(session.calls or session.confirming for session in sessions) and not hurry():
            confirmed_at = max(session.confirmed_at for session in sessions)
            if time.monotonic() >= min(max(began, confirmed_at), began + LONGEST_GRACE) + grace:
                break
            Flag().wait(_LOOK)
        _await_settled(sessions)
        ledgers.flush()
    finally:
        warn_of_goals_left(_give_up_waiting(sessions))


def _await_settled(sessions: list[Session]) -> None:
    """Wait a moment: a call that has just left its session may still have to tell its ledger."""
    until = time.monotonic() + _SETTLING
    for session in sessions:
        settled = Flag()
        session.call_soon(settled.set)
        settled.wait(max(0.0, until - time.monotonic()))


def _give_up_waiting(sessions: list[Session]) -> list[tuple[str, uuid.UUID]]:
    """Stop all waits for goals that may be running; return those that the user must hear about."""
    left = []
    for session in sessions:
        untold = session.take_untold()
        if untold or session.calls:
            session.interrupted_at = time.monotonic()
        left += untold
    return left


def forget_inherited() -> None:
    """In a forked child: do not touch what the parent's sessions own (R20)."""
    _inherited.extend(open_sessions)
    open_sessions.clear()
    runtimes.forget_inherited()
    _in_hand.after_fork()
    _diagnostics.after_fork()


def arm() -> None:
    """Register these functions for this process. It may be called several times."""
    _arm_once()
    process = sys.modules.get("multiprocessing.process")
    if process is not None and process.parent_process() is not None:
        _arm_child(os.getpid())


@cache
def _arm_once() -> None:
    signals.cancel_goals = cancel_goals
    atexit.register(close_all)
    os.register_at_fork(after_in_child=forget_inherited)


@cache
def _arm_child(_: int) -> None:
    """Register in a child of `multiprocessing`, which ends without the functions of `atexit`."""
    from multiprocessing import util

    util.Finalize(None, close_all, exitpriority=_BEFORE_OTHERS)

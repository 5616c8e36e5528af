"""Tells of goals that may still be running where no error of ours tells it (C2.8)."""

from __future__ import annotations

import contextlib
import logging
import sys
import uuid

from actionkit._calls.errors.still_running import name_those_left
from actionkit._calls.futures.call_view import GoalsOfCall
from actionkit._threads.diagnostics import log_later, write_to_stderr

_log = logging.getLogger("actionkit")
LINGER = 30.0
"""Seconds that a closed client waits for the late acceptance of a goal (C2.4). A server that is
busy in a callback answers only after the callback, and few callbacks take longer."""
_NAMED = 10
"""How many goals the warning names, so that it stays readable; the log of the goals has all."""

_STOP_IT = "Stop the robot by other means if it must not move."

_muted = False


def mute() -> None:
    """Do not warn any more: the command line itself reports what happened to its goal."""
    global _muted  # noqa: PLW0603  a process runs one command
    _muted = True


def warn_of_goals_left(goals: list[tuple[str, uuid.UUID]], seconds: float | None = None) -> None:
    """Warn of goals that the caller gave up on and that are not known to have stopped.

    In the log and on standard error, because a robot may be moving without anybody watching. Each
    goal is given by its action and id. `seconds` is how long we still ask to cancel them, if we do.
    """
    if not goals or _muted:
        return
    named = ", ".join(f"{action} {goal_id}" for action, goal_id in goals[:_NAMED])
    more = f" and {len(goals) - _NAMED} more" if len(goals) > _NAMED else ""
    after = (
        ""
        if seconds is None
        else f" It goes on asking for {seconds:g} s, or until this program ends."
    )
    _warn(
        f"{len(goals)} goal{'s' if len(goals) > 1 else ''} MAY STILL BE RUNNING: no server has"
        f" confirmed that {named}{more} stopped.{after} {_STOP_IT}"
    )


def tell_of_goals_left(error: BaseException, action_name: str, goals: GoalsOfCall) -> None:
    """Add the goals of a call that may run to the error that interrupted it, and warn of them.

    `CancelledError` and `KeyboardInterrupt` have no text. A service or a notebook goes on after
    them for hours, and its closing would warn too late.
    """
    left = name_those_left(goals.reports)
    if not left:
        return
    happened = f"the call of action {action_name!r} was interrupted.{left}"
    ids = " ".join(map(str, goals.may_run[:_NAMED]))
    advice = f"`actionkit cancel {action_name} {ids}` asks the server once more. {_STOP_IT}"
    if not goals.user_knows and not _muted:
        _warn(f"{happened} {advice}")
    goals.tell()
    with contextlib.suppress(Exception):  # a class of the user's may not allow it
        if sys.version_info >= (3, 11):
            error.add_note(advice)
        if not isinstance(error, Exception):  # those that handlers of signals raise have a text
            # anyio looks at the first argument of a cancellation, so this one comes last.
            error.args = (*error.args, happened)


def _warn(text: str) -> None:
    if _log.hasHandlers():  # without handlers, logging itself would write to standard error
        log_later(logging.WARNING, text)
    if not _logs_to_stderr():
        write_to_stderr(f"actionkit: {text}")


def _logs_to_stderr() -> bool:
    """Whether a handler of the user's writes warnings of our logger to standard error."""
    if not _log.isEnabledFor(logging.WARNING):
        return False
    logger: logging.Logger | None = _log
    while logger is not None:
        for handler in logger.handlers:
            on_stderr = getattr(handler, "stream", 0) in (sys.stderr, sys.__stderr__)
            if on_stderr and handler.level <= logging.WARNING:
                return True
        logger = logger.parent if logger.propagate else None
    return False

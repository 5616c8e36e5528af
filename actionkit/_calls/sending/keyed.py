"""Gives a call its key in the ledger, and finds out what an earlier call with the key has done."""

from __future__ import annotations

import logging
import time
import uuid
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any, Protocol

from actionkit._calls.sending.request import Request
from actionkit._goal.effects import End, Ending
from actionkit._messages.convert import to_plain
from actionkit._messages.paths import layout_of
from actionkit._model.settings import RetryPolicy
from actionkit._model.values import GoalState
from actionkit._threads.diagnostics import log_later
from actionkit._threads.function_runner import Scheduler

if TYPE_CHECKING:
    from actionkit._calls.ledger.file import LedgerFile
    from actionkit._calls.ledger.keys import Asked, KeyHold

_LONGEST = 200
"""Characters of a key."""
_FAILED = (None, GoalState.REJECTED, GoalState.ABORTED, GoalState.CANCELED)
"""The last states of a goal that has not done what its key is for; `None` if it was not sent."""
_NOT_WRITTEN = (
    "the end of the call with key %r could not be written down (%s). The next call with it asks the"
    " server about the goal, and fails if that has forgotten it"
)


class KeySession(Scheduler, Protocol):
    """What is needed of the session."""

    ledger: LedgerFile | None
    action_name: str
    type_name: str
    connection: Any


def check_key(key: object, session: KeySession, retry: RetryPolicy, replaces: object) -> None:
    """Check `key=` of a call, and what does not go with it.

    Raises:
        TypeError: It is not a string.
        ValueError: It is empty or too long; there is no ledger; or it does not go with another
            argument.
    """
    if not isinstance(key, str):
        raise TypeError(f"key={key!r} must be a str, such as 'leg-3'")
    if not 0 < len(key) <= _LONGEST:
        raise ValueError(f"key={key[:20]!r} must have 1 to {_LONGEST} characters")
    if session.ledger is None:
        raise ValueError(
            f"key={key!r} needs a ledger, which remembers what was done:"
            " Client(…, ledger=Ledger('mission.db')), or the environment variable ACTIONKIT_LEDGER"
        )
    if retry.resend in ("server_gone", "always"):
        raise ValueError(
            f"key={key!r} does not go with RetryPolicy(resend={retry.resend!r}), which allows"
            " another goal while one may still run: leave `resend` out"
        )
    if replaces is not None:
        raise ValueError(
            f"key={key!r} does not go with replaces=: the goal of a key is sent once. Wait for the"
            " earlier call, or cancel it"
        )


def take_key(session: KeySession, request: Request) -> tuple[KeyHold, Request]:
    """Write a call with a key down. If an earlier one has sent its goal, attach to that.

    Raises:
        LedgerError: The file cannot be used; or another call, in flight or of another process, has
            the key.
        ValueError: The key was used for something else.
    """
    from actionkit._calls.ledger.keys import Asked

    action, key = session.connection.action_type, request.key
    assert session.ledger is not None
    assert key is not None  # its arguments are checked
    asked = Asked(
        session.action_name,
        session.type_name,
        layout_of(action.Goal, action.Result),
        session.connection.identity.domain_id,
        session.connection.pack(request.goal),
    )

    def check(earlier: Asked) -> None:
        if (what := _difference(session, earlier, asked)) is not None:
            raise ValueError(
                f"key={key!r} was used with {what}. Use another key, or ledger.forget({key!r})"
            )

    attempts, judged = request.most_attempts, request.classify is not None
    hold = session.ledger._take(key, asked, check, attempts=attempts, judged=judged)
    goal_id = hold.id_of(hold.attempt) if hold.joins else None
    return hold, replace(request, attach=goal_id)


def _difference(session: KeySession, earlier: Asked, asked: Asked) -> str | None:
    """Return what differs, as a noun with its values; `None` if both ask for the same."""
    for name, was, now in (
        ("action", earlier.action_name, asked.action_name),
        ("action type", earlier.type_name, asked.type_name),
        ("ROS_DOMAIN_ID", earlier.domain_id, asked.domain_id),
    ):
        if was != now:
            return f"another {name}: {was}, and not {now}"
    if earlier.layout != asked.layout:
        return f"another version of {asked.type_name}, with other fields"
    if earlier.goal == asked.goal:
        return None
    cls = session.connection.action_type.Goal  # the bytes between two fields may differ
    one, other = (
        to_plain(session.connection.unpack(earlier.goal, cls)),
        to_plain(session.connection.unpack(asked.goal, cls)),
    )
    return _first_difference(one, other, "")


def _first_difference(was: Any, now: Any, path: str) -> str | None:
    if was == now or (was != was and now != now):
        return None
    if isinstance(was, dict):
        pairs = [(f"{path}.{name}".lstrip("."), was[name], now[name]) for name in was]
    elif isinstance(was, list) and len(was) == len(now):
        pairs = [(f"{path}[{i}]", one, now[i]) for i, one in enumerate(was)]
    else:
        return f"another goal: {path} was {_short(was)}, and not {_short(now)}"
    differences = (_first_difference(one, other, name) for name, one, other in pairs)
    return next((text for text in differences if text is not None), None)


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:60]}…"


class CallKey:
    """The key of one call, while it runs and until its goals have stopped.

    On the communication thread.
    """

    def __init__(self, hold: KeyHold, session: KeySession, *, judged: bool) -> None:
        self.hold = hold
        self._session = session
        self._judged = judged
        self._state: GoalState | None = GoalState.SENT if hold.joins else None
        """The latest state of the latest goal; `None` if it was not sent."""
        self._result: bytes | None = None
        """The result of the latest goal, serialised, before a function of the user's has it."""
        self._may_run = False  # though the call is over
        self._follows = False  # the goal of an earlier call, or has sent one

    @property
    def kept(self) -> tuple[Any, str]:
        """The result of the earlier call that succeeded, and a text for the timeline."""
        hold, connection = self.hold, self._session.connection
        assert hold.result is not None
        when = time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(hold.since))
        result = connection.unpack(hold.result, connection.action_type.Result)
        return result, f"kept in the ledger since {when}; nothing was sent"

    def record(self, goal_id: uuid.UUID, state: GoalState) -> None:
        """A goal of the call is in another state."""
        self._follows = True
        if goal_id == self.hold.id_of(self.hold.attempt):
            self._state = state

    def keep(self, result: Any) -> None:
        """A goal has ended with this result, which is not judged yet."""
        self._result = None if result is None else self._session.connection.pack(result)

    def pause(self) -> None:
        """The call pauses before its next goal, in which its program may be killed."""
        if self._state in _FAILED:
            self.hold.stopped()

    def sends(self, goal: int, then: Callable[[Exception | None], None]) -> None:
        """Write down that the goal with this number is to be sent; then call `then`.

        `then` gets what was wrong, if anything; then it must not be sent.
        """
        self._state = None
        self.hold.sends(goal, lambda why: self._session.call_soon(partial(then, why)))

    def end(self, ending: Ending, then: Callable[[], None], *, ok: bool, may_run: bool) -> None:
        """Write down how the call has ended, then call `then`; its goal may run on."""
        from actionkit._calls.ledger.keys import KeyState

        if self.hold.result is not None:
            then()
            return
        if self.hold.joins and not self._follows:
            self.hold.give_back(partial(self._written, then))
            return
        # A late success is one, too, though its caller had given up.
        late = self._state is GoalState.SUCCEEDED and not self._judged
        done = self._result is not None and (ok or late)
        rejected = ending.end is End.REJECTED_BY_CLASSIFIER
        self._judged &= ending.end is not End.ABORTED
        ended_as = ending.ended_as or self._state  # the first is without its result
        failed = self._failed(self._state) or self._failed(ended_as)
        self._may_run = may_run and not ending.abandoned
        state = KeyState.SENT
        if done:
            state = KeyState.SUCCEEDED
        elif may_run:
            state = KeyState.LEFT if ending.abandoned else KeyState.SENT
        elif rejected or (failed and ending.classifier_fault is None):
            state = KeyState.STOPPED
        result = self._result if done else None
        self.hold.end(state, result, partial(self._written, then), runs=self._may_run)

    def _written(self, then: Callable[[], None], problem: Exception | None) -> None:
        if problem is not None:
            log_later(logging.ERROR, _NOT_WRITTEN, self.hold.key, problem)
        self._session.call_soon(then)

    def goal_over(self) -> None:
        """Write down that the goal has stopped, if that is after the end of the call."""
        from actionkit._calls.ledger.keys import KeyState

        if self._may_run:
            self._may_run = False
            state = KeyState.STOPPED if self._failed(self._state) else KeyState.SENT
            self.hold.end(state, None, lambda _: None, runs=False)

    def _failed(self, state: GoalState | None) -> bool:
        """Whether another goal may be sent, and not only because this one does not run any more.

        With `classify=`, an abort that nobody has judged may be a success.
        """
        return state in _FAILED and not (state is GoalState.ABORTED and self._judged)

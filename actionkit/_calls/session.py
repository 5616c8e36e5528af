"""The calls of one client, and their end.

A session outlives its client by as much as its goals need: one that was given up on is watched
until it is known not to run any more (C2.4).
"""

from __future__ import annotations

import math
import os
import time
import uuid
from typing import Any, Literal

from actionkit._calls.call import Call
from actionkit._calls.carrier import LINGER, PortCarrier
from actionkit._calls.drivers import find_driver
from actionkit._calls.future import GoalFuture
from actionkit._calls.left_running import warn_of_goals_left
from actionkit._calls.request import Request
from actionkit._model.errors import ClientClosedError
from actionkit._model.settings import LONGEST_GRACE
from actionkit._observers.dispatcher import ObserverDispatcher
from actionkit._observers.protocol import Observer
from actionkit._ros.port import Port
from actionkit._threads.in_hand import patience
from actionkit._threads.pool import Pool

OnClose = Literal["cancel", "abandon"]
MARGIN = 0.5
"""Seconds that closing may take beyond the wait for cancellations: the communication thread needs
milliseconds to end the calls, and a busy machine some more."""
_INTERRUPTED_FOR = 2.0
"""Seconds after Ctrl-C ended a wait for cancellations in which no other is begun. The exit of the
`with` block and of the interpreter follow within that time."""
OBSERVERS_TIMEOUT = 1.0
"""Seconds that closing, and the interpreter's exit, wait for slow observers: enough to write a few
thousand lines to a file, and not so long that a blocked observer is noticed as a hang."""
FREEING_TIMEOUT = 5.0
"""Seconds that the freeing of entities may take; it takes milliseconds on an idle machine."""


class Session:
    """The calls of one client. Any thread may use it."""

    def __init__(
        self,
        port: Port,
        on_close: OnClose,
        cancel_grace: float,
        observers: tuple[Observer, ...] = (),
    ) -> None:
        """Take over a port.

        Args:
            port: It is the session's own.
            on_close: What closing does to goals in flight.
            cancel_grace: `Timeouts.cancel`.
            observers: The observers of the goals, already checked.
        """
        self.cancel_grace = cancel_grace
        self._interrupted_at = -math.inf
        """Monotonic time at which Ctrl-C ended a wait for cancellations."""
        self._pid = os.getpid()
        self._closed = False
        self.port = port
        self._carrier = PortCarrier(port, self._on_freed, abandon=on_close == "abandon")
        identity = self.identity = port.identity
        self.action_name = identity.action_name
        self._dispatcher = ObserverDispatcher(
            observers,
            action_name=identity.action_name,
            action_type=identity.type_name,
            node_name=identity.label,
        )
        self.callbacks = Pool(identity.action_name)
        """Where the user's callbacks run."""
        open_sessions.add(self)

    @property
    def closed(self) -> bool:
        """Whether it takes no more calls: it was closed, or cannot go on."""
        return self._closed or bool(self._carrier.ended_because)

    @property
    def pending(self) -> int:
        """How many calls are in flight."""
        return len(self._carrier.calls)

    def prepare(self, request: Request) -> Call:
        """Make a call. Its time runs from now; it sends nothing yet."""
        return Call(self._carrier, request, self._dispatcher)

    def begin(self, call: Call) -> None:
        """Begin a call that was prepared. Calls begin in this order.

        One that is begun just after the closing ends at once, and sends nothing.

        Raises:
            ClientClosedError: The session was closed.
        """
        self.check()
        call.begin()

    def wait_for_server(self, timeout: float | None) -> bool:
        """Block until goals can be sent; return whether they can.

        Args:
            timeout: Seconds, or `None` for no limit.

        Raises:
            ClientClosedError: The session was closed, perhaps meanwhile.
            RuntimeError: This process was forked from the session's.
        """
        self.check()
        with self.port.server_wait(timeout) as wait:
            wait.over.wait(wait.seconds)
        if not wait.ready:
            self.check()
        return wait.ready or (timeout == 0 and self.port.server_is_ready())

    async def wait_for_server_async(self, timeout: float | None) -> bool:
        """Like `wait_for_server`, but without blocking what runs this coroutine.

        Raises:
            RuntimeError: Also where nothing runs this coroutine that could wait.
        """
        driver = find_driver()
        self.check()
        with self.port.server_wait(timeout) as wait:
            await driver.wait(wait.over)
        if not wait.ready:
            self.check()
        return wait.ready

    def check(self) -> None:
        """Raise where no call can begin.

        Raises:
            ClientClosedError: The session was closed, or cannot go on.
            RuntimeError: This process was forked from the session's.
        """
        self._check_open()
        if why := self._carrier.ended_because or self.port.why_shut_down():
            # A program that was told to end starts no goals.
            raise ClientClosedError(
                f"the client of action {self.action_name!r} takes no more calls, because {why}:"
                " make a new client",
                action_name=self.action_name,
            ) from self.port.runtime.failure

    def _check_open(self) -> None:
        if os.getpid() != self._pid:
            raise RuntimeError(
                f"this Client was made in process {self._pid} and cannot be used in process"
                f" {os.getpid()}, which was forked from it: the middleware's threads are not here."
                " Start processes with the 'spawn' method, or before the first Client"
            )
        if self._closed:
            raise ClientClosedError(
                f"the client of action {self.action_name!r} is closed: make a new one, or call"
                " inside its `with` block",
                action_name=self.action_name,
            )

    def cancel_all(self) -> int:
        """Cancel every call in flight; return how many there were.

        Raises:
            ClientClosedError: The session was closed.
            RuntimeError: This process was forked from the session's.
        """
        self._check_open()
        return self.cancel_calls()

    def cancel_calls(self, *, urgent: bool = False) -> int:
        """Do so also where the session was closed; `urgent` as for `Call.request_cancel`."""
        calls = self._calls()
        for call in calls:
            call.request_cancel(urgent=urgent)
        return len(calls)

    # --- the end ---------------------------------------------------------------------------

    @property
    def was_interrupted(self) -> bool:
        """Whether Ctrl-C has just ended a wait for cancellations: then none is begun."""
        return time.monotonic() - self._interrupted_at < _INTERRUPTED_FOR

    def close(self) -> None:
        """End every call by the policy `on_close`, within a bound, and free what is held."""
        if os.getpid() != self._pid:
            return  # everything here belongs to the process that was forked
        self.close_calls()
        try:
            try:
                if not self.was_interrupted:
                    self._await_ends(self.futures(), self.cancel_grace + MARGIN)
                self.end_grace()
            finally:
                self.release_and_wait()
            left = self._told_now()
            seconds = None if self.await_freed(time.monotonic()) else LINGER  # none for lost goals
            warn_of_goals_left(left, seconds)
            if not self.was_interrupted:
                self.callbacks.dues.finish(time.monotonic() + patience(self.cancel_grace))
        finally:
            self.callbacks.dues.end()
        self._dispatcher.flush(time.monotonic() + OBSERVERS_TIMEOUT)

    def close_calls(self) -> None:
        """Take no more calls, and begin to end those in flight by the policy `on_close`."""
        self._closed = True
        self._carrier.call_soon(self._carrier.close_calls)

    def end_grace(self) -> None:
        """Wait no longer for cancellations to be confirmed: end the calls that are left."""
        if left := self.futures():
            self._carrier.call_soon(self._carrier.end_grace)
            await_ends(left, MARGIN)

    def await_cancel(self, future: GoalFuture[Any, Any]) -> None:
        """Wait for a call that was just cancelled, within `Timeouts.cancel`."""
        if not self.was_interrupted:
            self._await_ends([future], self.cancel_grace)

    def _await_ends(self, futures: list[GoalFuture[Any, Any]], grace: float) -> None:
        try:
            await_ends(futures, grace)
        except KeyboardInterrupt:
            self._interrupted_at = time.monotonic()
            raise

    def futures(self) -> list[GoalFuture[Any, Any]]:
        """Return the futures of the calls in flight."""
        return [call.future for call in self._calls()]

    def _told_now(self) -> list[tuple[str, uuid.UUID]]:
        """Return the goals that may be running, with the action's name, to be told of now.

        Those that were told of before are left out: by a warning, or by the end of their call.
        """
        left = self._carrier.untold()
        for goal in left:
            goal.told = True
        return [(self.action_name, goal.goal_id) for goal in left if goal.goal_id]

    @property
    def confirming(self) -> bool:
        """Whether any goal may soon be confirmed to have stopped."""
        return self._carrier.confirming

    def give_up_waiting(self) -> list[tuple[str, uuid.UUID]]:
        """Wait no more for the goals that may be running; return those to be told of."""
        left = self._told_now()
        if left or self.pending:
            self._interrupted_at = time.monotonic()
        return left

    def _calls(self) -> list[Call]:
        return list(self._carrier.calls)

    def release_and_wait(self) -> None:
        """Release, and wait until what no goal needs is freed."""
        self.release()
        until = time.monotonic() + FREEING_TIMEOUT
        self._carrier.released.wait(FREEING_TIMEOUT)
        if self.port.freed.is_set():
            self.port.runtime.join_if_stopping(max(0.0, until - time.monotonic()))

    def release(self) -> None:
        """Free the port as soon as no goal needs it. Never blocks.

        A client that is garbage collected without `close()` does only this.
        """
        if os.getpid() != self._pid:
            return
        self._closed = True
        self._carrier.call_soon(self._carrier.release)

    def given_up_at(self, orphans_at: float) -> float:
        """Return when the last goal was given up on that may be running; see `PortCarrier`."""
        return self._carrier.given_up_at(orphans_at)

    @property
    def confirmed_at(self) -> float:
        """Monotonic time at which a server last answered a cancel request."""
        return self.port.link.others_confirmed_at

    def await_freed(self, until: float) -> bool:
        """Wait until the port is freed, so no goal is watched; return whether it is so."""
        return self.port.freed.wait(max(0.0, until - time.monotonic()))

    def free(self) -> None:
        """Free the port now, even if goals need it."""
        self._carrier.call_soon(self._carrier.free)
        self.port.freed.wait(FREEING_TIMEOUT)

    def _on_freed(self) -> None:
        if self._closed:
            open_sessions.discard(self)


def await_ends(futures: list[GoalFuture[Any, Any]], grace: float) -> None:
    """Wait for calls to end, for as long as some of them do so within each `grace` seconds."""
    latest = time.monotonic() + grace + LONGEST_GRACE
    before = len(futures) + 1
    while futures and len(futures) < before and time.monotonic() < latest:
        before = len(futures)
        until = time.monotonic() + grace
        if all(future._wait_until_over(until - time.monotonic()) for future in futures):
            return
        futures = [future for future in futures if not future.done()]


open_sessions: set[Session] = set()
"""Sessions with a port that is not freed, for the interpreter's exit."""

"""One client's life: its carriers, and its end, however that comes.

A session outlives its client by as much as its goals need: one that was given up on is watched
until it is known to run no more (contract C2.4).
"""

from __future__ import annotations

import contextlib
import math
import os
import threading
import time
import uuid
from collections.abc import Callable
from typing import Any, Literal

from actionkit._calls.call import Call
from actionkit._calls.carrier import LINGER, PortCarrier
from actionkit._calls.future import GoalFuture
from actionkit._calls.left_running import tell_of_goals_left
from actionkit._calls.request import Request
from actionkit._model.errors import ClientClosedError
from actionkit._model.settings import LONGEST_GRACE
from actionkit._observers.dispatcher import Audience
from actionkit._observers.protocol import Observer
from actionkit._ros.port import Port

OnClose = Literal["cancel", "abandon"]
MARGIN = 0.5
"""Seconds that closing may take beyond the wait for cancellations."""
_HURRY = 2.0
"""Seconds; who interrupts a wait for cancellations does not want another one after it."""
TELLING = 1.0
"""Seconds that closing, and the interpreter's exit, wait for slow observers."""
_TURN = 2.0
"""Seconds to wait for another thread that opens a port; a second one does no harm."""
FREEING = 5.0
"""Seconds that the freeing of entities may take; it takes milliseconds on an idle machine."""


class Session:
    """Carries the calls of one client. Any thread may use it."""

    def __init__(
        self,
        open_port: Callable[[], Port],
        on_close: OnClose,
        cancel_grace: float,
        observers: tuple[Observer, ...] = (),
    ) -> None:
        """Open the first port.

        Args:
            open_port: Opens a port; called again where a port became unusable.
            on_close: What closing does to goals in flight.
            cancel_grace: `Timeouts.cancel`.
            observers: Who is told what happens to the goals.
        """
        self.cancel_grace = cancel_grace
        self._open_port = open_port
        self._on_close = on_close
        self.interrupted_at = -math.inf
        """Monotonic time at which a human did not want to wait any longer."""
        self._told_left: list[uuid.UUID] = []
        self._pid = os.getpid()
        self._opening = threading.RLock()
        """So that threads which come at the same time open one port anew, and not one each.

        The communication thread never waits for it, and nobody waits for it for long.
        """
        self._closed = False
        self._carriers = [PortCarrier(open_port(), self._on_freed)]
        identity = self._carriers[0].port.identity
        self.action_name = identity.action_name
        self._audience = Audience(
            observers,
            action_name=identity.action_name,
            action_type=identity.type_name,
            node_name=identity.label,
        )
        live.add(self)

    @property
    def closed(self) -> bool:
        """Whether the session was closed."""
        return self._closed

    @property
    def pending(self) -> int:
        """How many calls are in flight."""
        return sum(len(carrier.calls) for carrier in list(self._carriers))

    @property
    def port(self) -> Port:
        """The port over which new goals go.

        Raises:
            ClientClosedError: The session was closed.
            RuntimeError: This process was forked from the session's.
        """
        return self._current().port

    def prepare(self, request: Request) -> Call:
        """Make a call, whose time runs from now, and which sends nothing so far.

        Raises:
            ClientClosedError: The session was closed.
            RuntimeError: This process was forked from the session's.
        """
        return Call(self._current(), request, self._audience)

    def begin(self, call: Call) -> None:
        """Begin a call that was prepared. Calls begin in this order (contract C1.12).

        One that is begun just behind the closing ends at once, and sends nothing.

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
        until = None if timeout is None else time.monotonic() + timeout
        while not self.port.wait_for_server(timeout):
            self.check()
            if until is not None and until <= time.monotonic():
                return False
            # The port was given up. Wait on, over the next.
            timeout = None if until is None else until - time.monotonic()
        return True

    def _current(self) -> PortCarrier:
        self.check()
        carrier = self._carriers[-1]
        return carrier if carrier.port.usable else self._renewed()

    def _renewed(self) -> PortCarrier:
        turn = self._opening.acquire(timeout=_TURN)
        try:
            carrier = self._carriers[-1]
            if not carrier.port.usable:
                # The context was shut down under us (R10), or the thread died (R8). Goals in
                # flight stay where they are; new ones go another way.
                carrier.call_soon(carrier.retire)
                carrier = PortCarrier(self._open_port(), self._on_freed)
                self._carriers.append(carrier)
                for old in list(self._carriers):
                    if old is not carrier and old.port.freed.is_set():
                        with contextlib.suppress(ValueError):  # others do the same
                            self._carriers.remove(old)
                if self._closed:
                    carrier.call_soon(carrier.retire)  # it may have been too late for `drop`
                    self.check()
            return carrier
        finally:
            if turn:
                self._opening.release()

    def check(self) -> None:
        """Raise where the session cannot be used.

        Raises:
            ClientClosedError: The session was closed.
            RuntimeError: This process was forked from the session's.
        """
        if os.getpid() != self._pid:
            raise RuntimeError(
                f"this Client was made in process {self._pid} and cannot be used in process"
                f" {os.getpid()}, which was forked from it: the middleware's threads are not here."
                " Start processes with the 'spawn' method, or before the first Client (C1.12)"
            )
        if self._closed:
            raise ClientClosedError(
                f"the client of action {self.action_name!r} is closed: make a new one, or call"
                " inside its `with` block",
                action_name=self.action_name,
            )

    def cancel_all(self) -> int:
        """Cancel every call in flight; return how many there were."""
        self.check()
        calls = self._calls()
        for call in calls:
            call.request_cancel()
        return len(calls)

    # --- the end ---------------------------------------------------------------------------

    @property
    def in_a_hurry(self) -> bool:
        """Whether a human has just interrupted the wait for cancellations."""
        return time.monotonic() - self.interrupted_at < _HURRY

    def close(self) -> None:
        """End every call by policy, within a bound, and free what is held."""
        if os.getpid() != self._pid:
            return  # the parent's: nothing here is ours to free
        self.begin_close()
        try:
            if not self.in_a_hurry:
                self._await_ends(self.futures(), self.cancel_grace + MARGIN)
            self.end_calls()
        finally:
            self.retire()
        left = self.running()
        self._told_left += left
        tell_of_goals_left([(self.action_name, goal_id) for goal_id in left], LINGER)
        self._audience.flush(time.monotonic() + TELLING)

    def begin_close(self) -> None:
        """Take no more calls, and begin to end those in flight."""
        self._closed = True
        abandon = self._on_close == "abandon"
        for carrier in list(self._carriers):
            carrier.call_soon(lambda c=carrier: c.close_calls(abandon=abandon))  # type: ignore[misc]

    def end_calls(self) -> None:
        """End what is left: nothing was confirmed for so long that it is not waited for."""
        if left := self.futures():
            for carrier in list(self._carriers):
                carrier.call_soon(carrier.end_calls)
            await_ends(left, MARGIN)

    def await_cancel(self, future: GoalFuture[Any, Any]) -> None:
        """Wait for a call that was just cancelled, within `Timeouts.cancel`."""
        self._await_ends([future], self.cancel_grace)

    def _await_ends(self, futures: list[GoalFuture[Any, Any]], grace: float) -> None:
        try:
            await_ends(futures, grace)
        except KeyboardInterrupt:
            self.interrupted_at = time.monotonic()
            raise

    def futures(self) -> list[GoalFuture[Any, Any]]:
        """Return the futures of the calls in flight."""
        return [call.future for call in self._calls()]

    def running(self) -> list[uuid.UUID]:
        """Return the ids of the goals that may be running, less those that were told of."""
        goals = [goal_id for carrier in list(self._carriers) for goal_id in carrier.running()]
        return [goal_id for goal_id in goals if goal_id not in self._told_left]

    def _calls(self) -> list[Call]:
        return [call for carrier in list(self._carriers) for call in list(carrier.calls)]

    def retire(self) -> None:
        """Free what is held: now, or as soon as no goal needs it."""
        self.drop()
        until = time.monotonic() + FREEING
        for carrier in list(self._carriers):
            carrier.retired.wait(max(0.0, until - time.monotonic()))
            if carrier.port.freed.is_set():
                carrier.port.runtime.join_if_stopping(max(0.0, until - time.monotonic()))

    def drop(self) -> None:
        """The client is gone: free what is held when the last call is over. Never blocks."""
        if os.getpid() != self._pid:
            return
        self._closed = True
        for carrier in list(self._carriers):
            carrier.call_soon(carrier.retire)

    @property
    def confirmed_at(self) -> float:
        """Monotonic time at which a server last answered to a cancellation."""
        return max(carrier.port.link.others_confirmed_at for carrier in list(self._carriers))

    def await_freed(self, until: float) -> bool:
        """Wait until no goal is watched any more; return whether it is so."""
        return all(
            carrier.port.freed.wait(max(0.0, until - time.monotonic()))
            for carrier in list(self._carriers)
        )

    def stop_watching(self) -> None:
        """Free what is held, whatever is watched."""
        for carrier in list(self._carriers):
            carrier.call_soon(carrier.free)
            carrier.port.freed.wait(FREEING)

    def _on_freed(self) -> None:
        if self._closed and all(c.port.freed.is_set() for c in list(self._carriers)):
            live.discard(self)


def await_ends(futures: list[GoalFuture[Any, Any]], grace: float) -> None:
    """Wait for calls to end, for as long as some of them do so within each `grace` seconds."""
    latest = time.monotonic() + grace + LONGEST_GRACE
    before = len(futures) + 1
    while futures and len(futures) < before and time.monotonic() < latest:
        before = len(futures)
        until = time.monotonic() + grace
        if all(future.wait_until_over(until - time.monotonic()) for future in futures):
            return
        futures = [future for future in futures if not future.done()]


live: set[Session] = set()
"""Sessions that hold something. Kept here for the interpreter's exit."""

"""One client's life: its carriers, and its end, however that comes.

A session outlives its client by as much as its goals need: one that was given up on is watched
until it is known to run no more (contract C2.4).
"""

from __future__ import annotations

import atexit
import concurrent.futures
import os
import threading
import time
from collections.abc import Callable
from typing import Literal

from actionkit import _asking, _delivery
from actionkit._call import Call
from actionkit._carrier import PortCarrier
from actionkit._errors import ClientClosedError
from actionkit._observers import channel as channels
from actionkit._observers.audience import Audience
from actionkit._observers.protocol import Observer
from actionkit._request import Request
from actionkit._ros import runtime as runtimes
from actionkit._ros.port import Port

OnClose = Literal["cancel", "abandon"]
_MARGIN = 0.5
"""Seconds that closing may take beyond the wait for cancellations."""
_TELLING = 1.0
"""Seconds that closing, and the interpreter's exit, wait for slow observers."""
_FREEING = 5.0
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
        self._pid = os.getpid()
        self._lock = threading.Lock()
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
        _live.add(self)

    @property
    def closed(self) -> bool:
        """Whether the session was closed."""
        return self._closed

    @property
    def pending(self) -> int:
        """How many calls are in flight."""
        return sum(len(carrier.calls) for carrier in self._carriers)

    @property
    def port(self) -> Port:
        """The port over which new goals go.

        Raises:
            ClientClosedError: The session was closed.
            RuntimeError: This process was forked from the session's.
        """
        with self._lock:
            return self._current().port

    def prepare(self, request: Request) -> Call:
        """Make a call, whose time runs from now, and which sends nothing so far.

        Raises:
            ClientClosedError: The session was closed.
            RuntimeError: This process was forked from the session's.
        """
        with self._lock:
            return Call(self._current(), request, self._audience)

    def begin(self, call: Call) -> None:
        """Begin a call that was prepared. Calls begin in this order (contract C1.12).

        Raises:
            ClientClosedError: The session was closed.
        """
        with self._lock:  # so that no call slips in behind the closing
            self.check()
            call.begin()

    def _current(self) -> PortCarrier:
        self.check()
        carrier = self._carriers[-1]
        if not carrier.port.usable:
            # The context was shut down under us (R10), or the thread died (R8). Goals in
            # flight stay where they are; new ones go another way.
            carrier.call_soon(carrier.retire)
            carrier = PortCarrier(self._open_port(), self._on_freed)
            self._carriers = [*(c for c in self._carriers if not c.port.freed.is_set()), carrier]
        return carrier

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
        calls = [call for carrier in self._carriers for call in list(carrier.calls)]
        for call in calls:
            call.request_cancel()
        return len(calls)

    # --- the end ---------------------------------------------------------------------------

    def close(self) -> None:
        """End every call by policy, within a bound, and free what is held."""
        if os.getpid() != self._pid:
            return  # the parent's: nothing here is ours to free
        self.begin_close()
        try:
            self.await_calls(time.monotonic() + self.cancel_grace + _MARGIN)
        finally:
            self.retire()
        self._audience.flush(time.monotonic() + _TELLING)

    def begin_close(self) -> None:
        """Take no more calls, and begin to end those in flight."""
        with self._lock:
            self._closed = True
        abandon = self._on_close == "abandon"
        for carrier in self._carriers:
            carrier.call_soon(lambda c=carrier: c.close_calls(abandon=abandon))  # type: ignore[misc]

    def await_calls(self, until: float) -> None:
        """Wait for the calls in flight to end."""
        futures = [call.future for carrier in self._carriers for call in list(carrier.calls)]
        concurrent.futures.wait(futures, max(0.0, until - time.monotonic()))

    def retire(self) -> None:
        """Free what is held: now, or as soon as no goal needs it."""
        self.drop()
        until = time.monotonic() + _FREEING
        for carrier in self._carriers:
            carrier.retired.wait(max(0.0, until - time.monotonic()))
            if carrier.port.freed.is_set():
                carrier.port.join(max(0.0, until - time.monotonic()))

    def drop(self) -> None:
        """The client is gone: free what is held when the last call is over. Never blocks."""
        if os.getpid() != self._pid:
            return
        self._closed = True
        for carrier in self._carriers:
            carrier.call_soon(carrier.retire)

    def stop_watching(self, until: float) -> None:
        """Wait until no goal is watched any more, then free what is held in any case."""
        for carrier in self._carriers:
            carrier.port.freed.wait(max(0.0, until - time.monotonic()))
            carrier.call_soon(carrier.free)
            carrier.port.freed.wait(_FREEING)

    def _on_freed(self) -> None:
        if self._closed and all(carrier.port.freed.is_set() for carrier in self._carriers):
            _live.discard(self)


_live: set[Session] = set()
"""Sessions that hold something. Kept here for the interpreter's exit."""
_inherited: list[Session] = []


def close_all() -> None:
    """End everything at the interpreter's exit, within a bound and in silence (C1.10)."""
    sessions = list(_live)
    until = time.monotonic() + max((s.cancel_grace for s in sessions), default=0.0) + _MARGIN
    try:
        for session in sessions:
            session.begin_close()
        for session in sessions:
            session.await_calls(until)
            session.retire()
        for session in sessions:
            session.stop_watching(until)
        # The middleware's own exit handlers crash under a thread that still uses it.
        runtimes.join_ending(_FREEING)
        channels.flush_all(time.monotonic() + _TELLING)
    except KeyboardInterrupt:
        return  # a human who does not want to wait for it


def forget_inherited() -> None:
    """In a forked child: what the parent's sessions hold is not ours to free (R20)."""
    _inherited.extend(_live)
    _live.clear()
    runtimes.forget_inherited()
    _delivery.after_fork()
    _asking.after_fork()
    channels.after_fork()


atexit.register(close_all)
os.register_at_fork(after_in_child=forget_inherited)

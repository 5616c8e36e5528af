"""The cancel requests of one client, a few at a time, each until it is answered.

A server's queue of cancel requests is 10 deep and drops what does not fit (R3), and who cancels a
thousand goals at once has a thousand requests. So no more than a window of them is on its way
unanswered; all clients of a process for one action share it. Those whose caller has little time
left go first, in every client.

A request that is not answered, or whose answer is that the server does not know the goal (which it
may yet accept, R6), is made again, less and less often. That is counted from the request itself,
so that what was spread over the window stays spread.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from actionkit._ros.outbox import CancelWindow
from actionkit._threads.clock import TimerHandle, Timers

ANSWERED_WITHIN = 0.5
"""Seconds after which an answer is not waited for any more before others are asked for. A server
that lives takes milliseconds, and some ten where it remembers thousands of goals."""
_PAUSES = (0.5, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 30.0)
"""Seconds from each request for one goal to the next; the last is repeated. The first few come
soon, because a process that ends waits for two seconds only."""


@dataclass(slots=True)
class _Wanted:
    """A goal that is to be cancelled.

    Attributes:
        urgent: Whether its caller has little time left.
        requests: How many were made since it was wanted last.
        request_outdated: Whether more has become known of it since the request on its way was sent, so that an
            answer "unknown goal" says nothing of now.
        again: Fires when it is to be asked for again; `None` while it waits for its turn.
    """

    urgent: bool
    requests: int = 0
    request_outdated: bool = False
    again: TimerHandle | None = None


class CancelQueue:
    """Asks for cancellations. On the communication thread only."""

    def __init__(
        self,
        timers: Timers,
        window: CancelWindow,
        *,
        send: Callable[[bytes], None],
        cancel_timer: Callable[[TimerHandle], None],
    ) -> None:
        """Ask for nothing so far.

        Args:
            timers: The clock and timers of the thread.
            window: Shared by all in this process who cancel goals of the same servers.
            send: Sends the request to cancel the goal with this id.
            cancel_timer: Takes back a timer.
        """
        self._timers = timers
        self._window = window
        self._send = send
        self._cancel_timer = cancel_timer
        self._wanted: dict[bytes, _Wanted] = {}
        self._turn: tuple[OrderedDict[bytes, None], OrderedDict[bytes, None]] = (
            OrderedDict(),  # urgent
            OrderedDict(),
        )
        self._unanswered: dict[bytes, TimerHandle] = {}

    def __len__(self) -> int:
        """How many goals are being cancelled."""
        return len(self._wanted)

    def ask(self, key: bytes, *, urgent: bool = False) -> None:
        """Ask for a goal's cancellation until it is answered; at once, where it was asked before.

        Args:
            key: The goal's id.
            urgent: Whether its caller has little time left.
        """
        wanted = self._wanted.get(key)
        if wanted is None:
            wanted = self._wanted[key] = _Wanted(urgent)
        wanted.urgent |= urgent
        wanted.requests = 0
        if key in self._unanswered:
            wanted.request_outdated = True
        else:
            self._queue(key, wanted)

    def answered(self, key: bytes, *, known: bool) -> None:
        """A server has answered.

        Args:
            key: The goal's id.
            known: Whether the server knows the goal. Else it is asked again.
        """
        if key in self._unanswered:
            self._window.answered()
            if known:
                self._window.confirmed(self._timers.now())
            self._give_back(key)
        wanted = self._wanted.get(key)
        if known:
            self.forget(key)
        elif wanted is not None and wanted.request_outdated:
            self._queue(key, wanted)

    def forget(self, key: bytes) -> None:
        """Ask no more: the goal has ended, or nobody is there to be asked."""
        wanted = self._wanted.pop(key, None)
        if wanted is not None:
            self._unqueue(key, wanted)
            self._give_back(key)

    def close(self) -> None:
        """Ask for nothing any more."""
        for queue in self._turn:
            queue.clear()  # first, or the places that are given back would be taken again
        self._window.forget(self._fill)
        for key in list(self._wanted):
            self.forget(key)

    def _queue(self, key: bytes, wanted: _Wanted) -> None:
        self._unqueue(key, wanted)
        self._turn[0 if wanted.urgent else 1][key] = None
        self._fill()

    def _unqueue(self, key: bytes, wanted: _Wanted) -> None:
        for queue in self._turn:
            queue.pop(key, None)
        if wanted.again is not None:
            self._cancel_timer(wanted.again)
            wanted.again = None

    def _fill(self) -> None:
        for queue, urgent in zip(self._turn, (True, False), strict=True):
            while queue and self._window.enter(self._fill, urgent=urgent):
                self._ask(queue.popitem(last=False)[0])

    def _ask(self, key: bytes) -> None:
        wanted = self._wanted[key]
        now = self._timers.now()
        self._unanswered[key] = self._timers.call_at(
            now + ANSWERED_WITHIN, partial(self._not_answered, key)
        )
        pause = _PAUSES[min(wanted.requests, len(_PAUSES) - 1)]
        wanted.requests += 1
        wanted.request_outdated = False
        wanted.again = self._timers.call_at(now + pause, partial(self._again, key))
        self._send(key)

    def _not_answered(self, key: bytes) -> None:
        self._window.unanswered()
        self._give_back(key)

    def _again(self, key: bytes) -> None:
        wanted = self._wanted[key]
        wanted.again = None
        self._queue(key, wanted)

    def _give_back(self, key: bytes) -> None:
        """Whatever has come of the request: another may be sent."""
        timer = self._unanswered.pop(key, None)
        if timer is not None:
            self._cancel_timer(timer)
            self._window.leave()

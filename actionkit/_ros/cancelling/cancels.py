"""Sends the cancel requests of one client, a few at a time, and repeats them until answered.

A client that cancels a thousand goals at once has a thousand requests, but a server's queue holds
ten (R3). So an outbox sends them. Goals with a caller that has little time left go first.

A request is repeated, at growing intervals, if it is not answered, or if the server does not know
the goal: it may still accept the goal (R6). The interval begins with the request, so requests that
the window has spread over time stay spread.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from actionkit._model.cancel_answer import CancelAnswer
from actionkit._ros.communication.outbox import WINDOW, Outbox, Window
from actionkit._threads.clock import TimerHandle, Timers

ANSWERED_WITHIN = 0.25
"""Seconds after which a request gives its place in the window to another. A live server answers in
milliseconds, in some tens of them if it remembers thousands of goals. With 0.5 s, one of ten
processes that cancel at the same time may get no answer in its two seconds."""
_PAUSES = (0.25, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 30.0)
"""Seconds between the requests for one goal; the last pause repeats. The first pauses are short,
because a process that ends waits for only two seconds."""
_LONGEST_WHERE_UNKNOWN = 300.0
"""The longest pause if the server has always answered that it does not know the goal."""


class CancelWindow(Window):
    """A window that is smaller while answers do not come.

    If several processes cancel at the same time, their windows together overrun the server's queue.
    They notice that only by missing answers. Each missing answer halves the window, and each answer
    widens it by a part of a place. So after a while, the processes share the queue.
    """

    def __init__(self, size: int = WINDOW) -> None:
        super().__init__(size)
        self._most = size
        self._room = float(size)
        self.progressed_at = -math.inf
        """Monotonic time at which a goal was last confirmed while other requests waited.

        It may be a goal of another process, with requests in the same queue. As long as the server
        goes on confirming goals, it makes sense to wait (contract C2.5).
        """

    def answered(self) -> None:
        """Widen the window: a request was answered."""
        self._resize(self._room + 1.0 / self._room)

    def unanswered(self) -> None:
        """Halve the window: a request that is not answered may have overrun the queue."""
        self._resize(self._room / 2)

    def note_progress(self, now: float) -> None:
        """Record that a server knows a goal or has ended it, by its answer."""
        if self._taken >= self._size or self._waiting[0] or self._waiting[1]:
            self.progressed_at = now

    def note_progress_of_others(self, now: float) -> None:
        """Record that the server has cancelled goals of other clients while our requests wait."""
        self.progressed_at = now

    def _resize(self, room: float) -> None:
        self._room = min(max(room, 1.0), float(self._most))
        self._size = int(self._room)


@dataclass(slots=True)
class _Cancellation:
    """A goal that is to be cancelled."""

    urgent: bool  # its caller has little time left
    asked_at: float = 0.0  # when `ask` was last called
    requests: int = 0  # how many were sent since then
    unknown: int = 0  # how many of the latest requests were answered with "unknown goal"
    outdated: bool = False
    """Whether `ask` was called after the unanswered request. The answer "unknown goal" to that
    request is then outdated."""
    timeout: TimerHandle | None = None
    """Ends the wait for the answer to a request; `None` while no request is unanswered."""
    repeat: TimerHandle | None = None
    """Starts the next request; `None` while the goal waits for a place in the window."""


class CancelQueue:
    """Sends the cancel requests. On the communication thread only."""

    def __init__(
        self,
        timers: Timers,
        window: CancelWindow,
        *,
        send: Callable[[bytes], None],
        cancel_timer: Callable[[TimerHandle], None],
    ) -> None:
        """Make a queue without requests.

        All code in this process that cancels goals of the same servers shares one window. `send`
        sends the request to cancel the goal with this id.
        """
        self._timers = timers
        self._window = window
        self._send = send
        self._cancel_timer = cancel_timer
        self._cancellations: dict[bytes, _Cancellation] = {}
        self._outbox: Outbox[_Cancellation] = Outbox(window, on_free=self._send_next)

    def __len__(self) -> int:
        """How many goals are being cancelled."""
        return len(self._cancellations)

    def ask(self, key: bytes, *, urgent: bool = False) -> None:
        """Ask for a goal's cancellation until it is answered; ask again now if it was asked before.

        `urgent` means that its caller has little time left.
        """
        cancellation = self._cancellations.get(key)
        if cancellation is None:
            cancellation = self._cancellations[key] = _Cancellation(urgent)
        cancellation.urgent |= urgent
        cancellation.asked_at = self._timers.now()
        cancellation.requests = cancellation.unknown = 0
        if cancellation.timeout is not None:
            cancellation.outdated = True
        else:
            self._enqueue(key, cancellation)

    def answered(self, key: bytes, answer: CancelAnswer, sent_at: float) -> None:
        """Handle a server's answer; `sent_at` is when its request was sent.

        The request is repeated if the server does not know the goal. It is also repeated if the
        server did not agree to a request that was sent before the last call of `ask`: micro-ROS'
        server calls a goal ended that it is just accepting.
        """
        known = answer is not CancelAnswer.UNKNOWN_GOAL
        cancellation = self._cancellations.get(key)
        if cancellation is None:
            return
        if cancellation.timeout is not None:
            self._window.answered()
            if known:
                self._window.note_progress(self._timers.now())
            self._end_wait(key, cancellation)
        cancellation.unknown += not known
        # As for the goal's machine: `ask` is called when a goal turns out to be accepted.
        outdated = answer is not CancelAnswer.ACCEPTED and sent_at < cancellation.asked_at
        if known and not outdated:
            self.stop(key)
        elif cancellation.outdated:
            self._enqueue(key, cancellation)

    def stop(self, key: bytes) -> None:
        """Send no more requests for a goal: it has ended, or no server is there to answer."""
        cancellation = self._cancellations.pop(key, None)
        if cancellation is not None:
            self._stop_repeat(cancellation)
            self._end_wait(key, cancellation)

    def close(self) -> None:
        """Send no more requests."""
        self._outbox.close()
        for key in list(self._cancellations):
            self.stop(key)

    def _enqueue(self, key: bytes, cancellation: _Cancellation) -> None:
        self._stop_repeat(cancellation)
        self._outbox.discard(key)  # it may be in the queue for goals that are not urgent
        self._outbox.put(key, cancellation, urgent=cancellation.urgent)
        self._send_next()

    def _send_next(self) -> None:
        while (taken := self._outbox.take()) is not None:
            key, cancellation = taken
            now = self._timers.now()
            cancellation.timeout = self._timers.call_at(
                now + ANSWERED_WITHIN, partial(self._not_answered, key, cancellation)
            )
            pause = _PAUSES[min(cancellation.requests, len(_PAUSES) - 1)]
            if cancellation.unknown >= len(_PAUSES):
                pause *= 2 ** min(cancellation.unknown - len(_PAUSES), 10)
                pause = min(pause, _LONGEST_WHERE_UNKNOWN)
            cancellation.requests += 1
            cancellation.outdated = False
            cancellation.repeat = self._timers.call_at(
                now + pause, partial(self._enqueue, key, cancellation)
            )
            self._send(key)

    def _not_answered(self, key: bytes, cancellation: _Cancellation) -> None:
        cancellation.unknown = 0  # the server may be busy, and accept the goal later
        self._window.unanswered()
        self._end_wait(key, cancellation)

    def _stop_repeat(self, cancellation: _Cancellation) -> None:
        if cancellation.repeat is not None:
            self._cancel_timer(cancellation.repeat)
            cancellation.repeat = None

    def _end_wait(self, key: bytes, cancellation: _Cancellation) -> None:
        """Give up the place in the window, or in the queue for a place."""
        if cancellation.timeout is not None:
            self._cancel_timer(cancellation.timeout)
            cancellation.timeout = None
        self._outbox.discard(key)

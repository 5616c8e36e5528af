"""Goals that have ended for their caller and may still run on another server (R14).

Two servers on one name both take every goal, and the first answer ends the goal for the caller.
The other server may go on running it. It may even have taken the goal before this side saw it, and
its acceptance may have been lost on the way (R4). So the goals that ended lately are remembered:

- A server that accepts one of them late runs it: the goal is a *confirmed* orphan. Its
  cancellation is asked for until that server has answered.
- A server that has just come may run any of them: the goals that ended not long before are
  *suspected* orphans, and the server is asked to cancel them. So is a goal that ends while there
  are several servers.

No more is asked for than fits into a server's queue (R3).
"""

from __future__ import annotations

import logging
import uuid
from collections import OrderedDict
from collections.abc import Callable, Collection, Sized
from dataclasses import dataclass, field
from functools import partial

from actionkit._ros.outbox import Window
from actionkit._threads.clock import Timers
from actionkit._threads.diagnostics import log_later

_REMEMBERED = 256
"""Goals; a bound for the memory. The newest are kept, because they are the likeliest to run."""
_RECENT = 20.0
"""Seconds; longer than any server took from accepting its first goals to being in sight here."""
_AT_ONCE = 4
"""Requests; half of a window, so that cancellations which a caller waits for are not held up."""
_ANSWERED_WITHIN = 0.2
"""Seconds until the next request may be sent; a server that lives answers in milliseconds."""
_TRIES = 5
"""How often the cancellation of a confirmed orphan is asked for, within 15 seconds."""
_TRIES_WHEN_SUSPECTED = 2
"""The same where nothing shows that any server has the goal; one request may get lost."""
_FIRST_PAUSE = 0.5
"""Seconds until a cancellation is asked for again; twice as long each time."""


_Ended = tuple[bytes, float, int, bool]
"""A goal's id, when it ended, how many servers accepted it, whether an acceptance is pending.

A plain tuple, which Python's collector need not look at again: every call leaves one.
"""


@dataclass(slots=True)
class _CancelRequest:
    """A cancel request for an orphan.

    Attributes:
        key: The goal's id.
        answers: How many servers have answered.
        ends: How many of them answered that the goal is ending or has ended.
    """

    key: bytes
    answers: int = 0
    ends: int = 0


@dataclass(slots=True)
class _Orphan:
    """A goal that is to be cancelled on every server that runs it.

    Attributes:
        late: How many servers accepted it after it had ended here, or beside the one it ended on.
        accepted: How many servers accepted it in all; 0 while `late` is 0.
        left: How many more times its cancellation is asked for.
        pause: Seconds until the next time.
        canceling: How many servers answered that they are cancelling it.
        requests: The numbers of the requests to cancel it.
    """

    late: int = 0
    accepted: int = 0
    left: int = _TRIES_WHEN_SUSPECTED
    pause: float = _FIRST_PAUSE
    canceling: int = 0
    requests: list[int] = field(default_factory=list)


class OrphanedGoals:
    """Finds such goals and cancels them. On the communication thread only."""

    def __init__(
        self,
        timers: Timers,
        action_name: str,
        *,
        count_servers: Callable[[], int],
        window: Window,
        cancel: Callable[[bytes], int],
        on_change: Callable[[], None],
    ) -> None:
        """Begin without any goal.

        Args:
            timers: The clock and timers of the thread.
            action_name: For the log.
            count_servers: Returns how many servers are in sight.
            window: One for all code in this process that cancels goals of the same servers.
            cancel: Asks every server to cancel a goal; returns the request's number.
            on_change: Called when there are more or fewer answers to wait for.
        """
        self.requests: dict[int, _CancelRequest] = {}
        """The cancel requests with answers that matter, by number."""
        self.on_none_confirmed: Callable[[], None] = lambda: None
        """Called when something has changed and no orphan is confirmed."""
        self._timers = timers
        self._action_name = action_name
        self._count_servers = count_servers
        self._window = window
        self._cancel = cancel
        self._on_change = on_change
        self._closed = False
        self._ended: OrderedDict[int, _Ended] = OrderedDict()
        self._orphans: dict[bytes, _Orphan] = {}
        # Those to ask the servers to cancel next, in order.
        self._confirmed: OrderedDict[bytes, None] = OrderedDict()
        self._suspected: OrderedDict[bytes, None] = OrderedDict()
        self._unanswered: set[int] = set()

    def __len__(self) -> int:
        """How many goals are being cancelled."""
        return len(self._orphans)

    @property
    def confirmed(self) -> bool:
        """Whether any goal is being cancelled that another server has surely accepted."""
        return any(orphan.late for orphan in self._orphans.values())

    @property
    def awaited(self) -> Sized:
        """The goal requests for which a late acceptance is worth waking up."""
        return self._ended if self._count_servers() > 1 else ()

    def ended(self, seq: int, key: bytes, *, accepted: int, pending: bool = False) -> None:
        """Remember a goal that has ended here.

        Args:
            seq: The number of its request.
            key: Its id.
            accepted: How many servers have accepted it.
            pending: Whether the acceptance by the server that ended it has yet to come.
        """
        self._ended[seq] = (key, self._timers.now(), accepted, pending)
        if len(self._ended) > _REMEMBERED:
            self._ended.popitem(last=False)
        if self._count_servers() > 1:
            self._suspect(key)

    def accepted_late(self, seq: int) -> None:
        """Handle that a server accepts a goal which has ended here.

        Args:
            seq: The number of the goal's request.
        """
        ended = self._ended.get(seq)
        if ended is None:
            return
        key, at, accepted, pending = ended
        self._ended[seq] = (key, at, accepted + 1, False)
        if not pending:
            self._confirm(key, accepted + 1, 1)

    def server_came(self) -> None:
        """Suspect the goals that ended lately: a server is ready that was not."""
        since = self._timers.now() - _RECENT
        for key, at, _, _ in list(self._ended.values()):
            if at >= since:
                self._suspect(key)

    def answered(self, seq: int, canceling: Collection[bytes], *, over: bool) -> None:
        """Take a server's answer to a cancel request into account.

        Args:
            seq: The request's number.
            canceling: The ids of the goals that it cancels now.
            over: Whether it says that the goal is ending or has ended already.
        """
        request = self.requests.get(seq)
        if request is None:
            return
        orphan = self._orphans[request.key]
        orphan.canceling += request.key in canceling
        request.ends += over or request.key in canceling
        request.answers += 1
        by_all = request.answers >= self._count_servers()
        over_everywhere = request.ends >= orphan.accepted if orphan.late else by_all
        if over_everywhere or orphan.canceling >= max(1, orphan.late):
            self._forget(request.key)
        elif by_all:
            self._end_wait(seq)

    def close(self) -> None:
        """Ask for nothing any more, and log the confirmed orphans that are left."""
        self._closed = True
        for key in list(self._orphans):
            self._give_up(key)
        self._window.stop_waiting(self._send_next)

    def _suspect(self, key: bytes) -> None:
        if key in self._orphans:
            return
        self._orphans[key] = _Orphan()
        self._suspected[key] = None
        if len(self._suspected) > _REMEMBERED:
            self._forget(next(iter(self._suspected)))
        self._send_next()

    def _confirm(self, key: bytes, accepted: int, late: int) -> None:
        orphan = self._orphans.setdefault(key, _Orphan())
        orphan.accepted = accepted
        orphan.late += late
        orphan.left, orphan.pause = _TRIES, _FIRST_PAUSE
        self._suspected.pop(key, None)
        self._confirmed[key] = None
        self._send_next()

    def _send_next(self) -> None:
        while len(self._unanswered) < _AT_ONCE and not self._closed:
            queue = self._confirmed or self._suspected
            if not queue or not self._window.enter(self._send_next):
                break
            self._send(queue.popitem(last=False)[0])

    def _send(self, key: bytes) -> None:
        orphan = self._orphans[key]
        seq = self._cancel(key)
        self._unanswered.add(seq)
        self.requests[seq] = _CancelRequest(key)
        orphan.requests.append(seq)
        orphan.left -= 1
        now = self._timers.now()
        self._timers.call_at(now + _ANSWERED_WITHIN, partial(self._end_wait, seq))
        self._timers.call_at(now + orphan.pause, partial(self._repeat, seq))
        orphan.pause *= 2
        self._changed()

    def _end_wait(self, seq: int) -> None:
        """Let the next request be sent, even if this one has not been answered."""
        if seq in self._unanswered:
            self._unanswered.discard(seq)
            self._window.leave()
        self._send_next()

    def _repeat(self, seq: int) -> None:
        request = self.requests.get(seq)
        if request is None or self._orphans[request.key].requests[-1] != seq:
            return  # it was answered, or there is a later one
        orphan = self._orphans[request.key]
        if not orphan.left:
            self._give_up(request.key)
        else:
            (self._confirmed if orphan.late else self._suspected)[request.key] = None
        self._send_next()

    def _give_up(self, key: bytes) -> None:
        if self._orphans[key].late:
            log_later(
                logging.WARNING,
                "goal %s of action %s was accepted by a server after it had ended for its caller,"
                " and that server did not confirm its cancellation: IT MAY STILL BE RUNNING."
                " Two servers on one name both run every goal: keep one of them",
                uuid.UUID(bytes=key),
                self._action_name,
            )
        self._forget(key)

    def _forget(self, key: bytes) -> None:
        orphan = self._orphans.pop(key)
        # First: a place in the window that is given back is taken at once, for one of these.
        self._confirmed.pop(key, None)
        self._suspected.pop(key, None)
        for seq in orphan.requests:
            del self.requests[seq]
            self._end_wait(seq)
        self._changed()
        self._send_next()

    def _changed(self) -> None:
        self._on_change()
        if not self.confirmed:
            self.on_none_confirmed()

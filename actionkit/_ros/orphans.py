"""Finds goals that have ended for their caller but may still run on another server (R14).

Two servers on one name both accept every goal, and the first answer ends the goal for the caller.
The other server may still execute the goal. It may even have accepted the goal before it was in
sight here, and its acceptance may have been lost (R4). So goals that have ended are remembered for
a while:

- If a server accepts such a goal late, it executes the goal: this is a *confirmed* orphan. Its
  cancellation is asked for until that server has answered.
- A new server may execute any of them. Goals that ended a short time before are *suspected*
  orphans, and the server is asked to cancel them. A goal that ends while there are several servers
  is suspected, too.

Never more requests are sent than fit into a server's queue (R3).
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
"""Goals that are kept at most: the newest, because they are the most likely to run."""
_RECENT = 20.0
"""Seconds: no server took longer from accepting its first goals until it was in sight."""
_AT_ONCE = 4
"""Requests: half of a window, so that cancellations with a waiting caller are not delayed."""
_ANSWERED_WITHIN = 0.2
"""Seconds until the next request may be sent; a live server answers in milliseconds."""
_TRIES = 5
"""How many times a confirmed orphan's cancellation is asked for, within 15 seconds."""
_TRIES_WHEN_SUSPECTED = 2
"""The same for a suspected orphan; one request may get lost."""
_FIRST_PAUSE = 0.5
"""Seconds until a cancellation is asked for again; doubled each time."""


_Ended = tuple[bytes, float, int, bool]
"""A goal's id, when it ended, how many servers accepted it, whether an acceptance is pending.

Every call leaves one, so it is a plain tuple: Python's garbage collector does not track it.
"""


@dataclass(slots=True)
class _CancelRequest:
    """A cancel request for an orphan."""

    key: bytes  # the goal's id
    answers: int = 0  # how many servers have answered
    ends: int = 0  # how many of them answered that the goal is ending or has ended


@dataclass(slots=True)
class _Orphan:
    """A goal that is to be cancelled on every server that runs it."""

    late: int = 0  # accepted by so many after it had ended here, or beside the one that ended it
    accepted: int = 0  # all servers that accepted it; 0 while `late` is 0
    left: int = _TRIES_WHEN_SUSPECTED  # how many more times its cancellation is asked for
    pause: float = _FIRST_PAUSE  # seconds until the next time
    canceling: int = 0  # servers that answered that they are cancelling it
    requests: list[int] = field(default_factory=list)  # the numbers of the requests to cancel it


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
            count_servers: Returns how many servers are in sight.
            window: Shared by all code in this process that cancels goals of the same servers.
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
        # The next goals to cancel, in order.
        self._confirmed: OrderedDict[bytes, None] = OrderedDict()
        self._suspected: OrderedDict[bytes, None] = OrderedDict()
        self._unanswered: set[int] = set()

    def __len__(self) -> int:
        """How many goals are being cancelled."""
        return len(self._orphans)

    @property
    def confirmed(self) -> bool:
        """Whether any goal that another server has surely accepted is being cancelled."""
        return any(orphan.late for orphan in self._orphans.values())

    @property
    def awaited(self) -> Sized:
        """The goal requests for which the thread should wait for a late acceptance."""
        return self._ended if self._count_servers() > 1 else ()

    def ended(self, seq: int, key: bytes, *, accepted: int, pending: bool = False) -> None:
        """Remember a goal that has ended here; `seq` is the number of its request.

        `accepted` servers have accepted it. `pending` means that the server that ended it has not
        sent its acceptance yet.
        """
        self._ended[seq] = (key, self._timers.now(), accepted, pending)
        if len(self._ended) > _REMEMBERED:
            self._ended.popitem(last=False)
        if self._count_servers() > 1:
            self._suspect(key)

    def accepted_late(self, seq: int) -> None:
        """Handle that a server accepts a goal that has ended here; `seq` is of its request."""
        ended = self._ended.get(seq)
        if ended is None:
            return
        key, at, accepted, pending = ended
        self._ended[seq] = (key, at, accepted + 1, False)
        if not pending:
            self._confirm(key, accepted + 1, 1)

    def server_came(self) -> None:
        """Suspect the goals that ended a short time ago, because a new server is ready."""
        since = self._timers.now() - _RECENT
        for key, at, _, _ in list(self._ended.values()):
            if at >= since:
                self._suspect(key)

    def answered(self, seq: int, canceling: Collection[bytes], *, over: bool) -> None:
        """Handle a server's answer to the cancel request with this number.

        `canceling` has the ids of the goals that it cancels now. `over` means that it says that the
        goal is ending or has ended already.
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
        """Send no more requests, and log the remaining confirmed orphans."""
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
            return  # it was answered, or there is a later request
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
        # First: a free place in the window is used at once, for one of these.
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

"""Goals that ended here and may be running on another server (R14).

Two servers on one name both take every goal, and the first answer ends it here. A server takes
goals before it is seen from here, and its acceptance may be lost on a way that it does not know
yet (R4). So what ended lately is remembered:

- A server that accepts one of them has it. Its cancellation is asked for until whoever has it
  has answered.
- A server that has just come may have any of them. It is asked to cancel those that ended not
  long before, and so are several servers whenever a goal ends on one of them.

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
_RECENT = 20.0
"""Seconds; as long as a server may be in the making, and longer than any was seen to be."""
_AT_ONCE = 4
_ANSWERED_WITHIN = 0.2
"""Seconds after which the answers that a request has not got are waited for no more."""
_TRIES = 5
_GUESSES = 2
"""How often a cancellation is asked for where nothing shows that anybody has the goal."""
_FIRST_PAUSE = 0.5
"""Seconds until a cancellation is asked for again; twice as long each time."""


_Ended = tuple[bytes, float, int, bool]
"""A goal's id, when it ended, how many servers have accepted it, whether one is yet to say so.

A plain tuple, which Python's collector need not look at again: every call leaves one.
"""


@dataclass(slots=True)
class _Request:
    """A cancel request: how many answers it has got, and how many of them that the goal ends."""

    key: bytes
    answers: int = 0
    ends: int = 0


@dataclass(slots=True)
class _Orphan:
    """A goal that is to be cancelled wherever it runs.

    Attributes:
        late: How many servers have accepted it when it had ended here, or was another's.
        accepted: How many have accepted it in all, where any did so late.
        left: How often its cancellation is still to be asked for.
        pause: Seconds until then.
        canceling: How many servers said that they are cancelling it.
        requests: The numbers of the requests to cancel it.
    """

    late: int = 0
    accepted: int = 0
    left: int = _GUESSES
    pause: float = _FIRST_PAUSE
    canceling: int = 0
    requests: list[int] = field(default_factory=list)


class OrphanedGoals:
    """Finds and cancels them. On the communication thread only."""

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
        """Remember nothing.

        Args:
            timers: The clock and timers of the thread.
            action_name: For the log.
            count_servers: Returns how many servers are in sight.
            window: Shared by all in this process who cancel goals of the same servers.
            cancel: Asks every server to cancel a goal; returns the request's number.
            on_change: Called when there is more or less to wait for.
        """
        self.asked: dict[int, _Request] = {}
        """The cancel requests whose answers matter."""
        self._timers = timers
        self._action_name = action_name
        self._count_servers = count_servers
        self._window = window
        self._cancel = cancel
        self._on_change = on_change
        self._closed = False
        self._ended: OrderedDict[int, _Ended] = OrderedDict()
        self._orphans: dict[bytes, _Orphan] = {}
        self._confirmed: OrderedDict[bytes, None] = OrderedDict()
        self._suspected: OrderedDict[bytes, None] = OrderedDict()
        self._on_the_way: set[int] = set()

    def __len__(self) -> int:
        """How many goals are being cancelled."""
        return len(self._orphans)

    @property
    def confirmed(self) -> bool:
        """Whether any of them is known to have been taken by another server."""
        return any(orphan.late for orphan in self._orphans.values())

    @property
    def awaited(self) -> Sized:
        """The requests of which late acceptances are worth waking up for."""
        return self._ended if self._count_servers() > 1 else ()

    def ended(
        self, seq: int, key: bytes, *, accepted: int, acceptance_pending: bool = False
    ) -> None:
        """Remember a goal that has ended here.

        Args:
            seq: The number of its request.
            key: Its id.
            accepted: How many servers have accepted it so far.
            acceptance_pending: Whether the server that ended it has not said yet that it had accepted it.
        """
        self._ended[seq] = (key, self._timers.now(), accepted, acceptance_pending)
        if len(self._ended) > _REMEMBERED:
            self._ended.popitem(last=False)
        if accepted > 1:
            self._found(key, accepted, accepted - 1)
        elif self._count_servers() > 1:
            self._suspect(key)

    def accepted_late(self, seq: int) -> None:
        """A server has accepted a goal that had ended here."""
        ended = self._ended.get(seq)
        if ended is None:
            return
        key, at, accepted, acceptance_pending = ended
        self._ended[seq] = (key, at, accepted + 1, False)
        if not acceptance_pending:
            self._found(key, accepted + 1, 1)

    def server_came(self) -> None:
        """A server can be asked that could not be asked before."""
        since = self._timers.now() - _RECENT
        for key, at, _, _ in list(self._ended.values()):
            if at >= since:
                self._suspect(key)

    def answered(self, seq: int, canceling: Collection[bytes], *, over: bool) -> None:
        """A server has answered a cancel request.

        Args:
            seq: The request's number.
            canceling: The ids of the goals that it cancels now.
            over: Whether it says that the goal ends or has ended already.
        """
        request = self.asked.get(seq)
        if request is None:
            return
        orphan = self._orphans[request.key]
        orphan.canceling += request.key in canceling
        request.ends += over or request.key in canceling
        request.answers += 1
        by_all = request.answers >= self._count_servers()
        over_everywhere = request.ends >= orphan.accepted if orphan.late else by_all
        if over_everywhere or orphan.canceling >= max(1, orphan.late):
            self._drop(request.key)
        elif by_all:
            self._arrived(seq)

    def close(self) -> None:
        """Ask nobody any more."""
        self._closed = True
        for key in list(self._orphans):
            self._give_up(key)
        self._window.forget(self._fill)

    def _suspect(self, key: bytes) -> None:
        if key in self._orphans:
            return
        self._orphans[key] = _Orphan()
        self._suspected[key] = None
        if len(self._suspected) > _REMEMBERED:
            self._drop(next(iter(self._suspected)))
        self._fill()

    def _found(self, key: bytes, accepted: int, late: int) -> None:
        orphan = self._orphans.setdefault(key, _Orphan())
        orphan.accepted = accepted
        orphan.late += late
        orphan.left, orphan.pause = _TRIES, _FIRST_PAUSE
        self._suspected.pop(key, None)
        self._confirmed[key] = None
        self._fill()

    def _fill(self) -> None:
        while len(self._on_the_way) < _AT_ONCE and not self._closed:
            queue = self._confirmed or self._suspected
            if not queue or not self._window.enter(self._fill):
                break
            self._ask(queue.popitem(last=False)[0])

    def _ask(self, key: bytes) -> None:
        orphan = self._orphans[key]
        seq = self._cancel(key)
        self._on_the_way.add(seq)
        self.asked[seq] = _Request(key)
        orphan.requests.append(seq)
        orphan.left -= 1
        now = self._timers.now()
        self._timers.call_at(now + _ANSWERED_WITHIN, partial(self._arrived, seq))
        self._timers.call_at(now + orphan.pause, partial(self._again, seq))
        orphan.pause *= 2
        self._on_change()

    def _arrived(self, seq: int) -> None:
        """Whatever a request has come to: the next may be sent."""
        if seq in self._on_the_way:
            self._on_the_way.discard(seq)
            self._window.leave()
        self._fill()

    def _again(self, seq: int) -> None:
        request = self.asked.get(seq)
        if request is None or self._orphans[request.key].requests[-1] != seq:
            return  # it was answered, or there is a later one
        orphan = self._orphans[request.key]
        if not orphan.left:
            self._give_up(request.key)
        elif orphan.late:
            self._confirmed[request.key] = None
        else:
            self._suspected[request.key] = None
        self._fill()

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
        self._drop(key)

    def _drop(self, key: bytes) -> None:
        for seq in self._orphans.pop(key).requests:
            del self.asked[seq]
            self._arrived(seq)
        self._confirmed.pop(key, None)
        self._suspected.pop(key, None)
        self._on_change()
        self._fill()

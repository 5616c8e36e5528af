"""The requests that one client makes of the servers, and whose each of them is.

All of it happens on the communication thread. A response cannot be taken before its request
is registered (R7), because the same thread sends and takes.
"""

from __future__ import annotations

import uuid
from collections import OrderedDict, deque
from collections.abc import Callable, Collection, Sized
from functools import lru_cache
from typing import Any

from action_msgs.srv import CancelGoal
from unique_identifier_msgs.msg import UUID

from actionkit._ros.cancels import CancelQueue
from actionkit._ros.entities import Entities
from actionkit._ros.native import Source
from actionkit._ros.orphans import OrphanedGoals
from actionkit._ros.runtime import Runtime

_UUIDS = 64
_QUESTIONS = 64
_ASKS_AT_ONCE = 4
_ASK_PAUSE = 0.01
"""Seconds between two handfuls of questions that were asked before."""


class Requests:
    """Sends requests, and knows the goal of each that is unanswered."""

    def __init__(
        self,
        runtime: Runtime,
        entities: Entities,
        impl: Any,
        *,
        action_name: str,
        count_servers: Callable[[], int],
        on_cancel_sent: Callable[[bytes], None],
    ) -> None:
        """Send nothing so far.

        Args:
            runtime: Whose thread this is.
            entities: What sends.
            impl: The action type's `Impl`.
            action_name: For the log.
            count_servers: Returns how many servers are in sight.
            on_cancel_sent: Called with the id of a goal whose cancellation was just asked for.
        """
        self._on_cancel_sent = on_cancel_sent
        self._runtime = runtime
        self._entities = entities
        self._impl = impl
        self._closed = False
        self._unanswered: dict[str, dict[int, bytes]] = {"goal": {}, "result": {}, "cancel": {}}
        self._made: dict[bytes, list[tuple[str, int]]] = {}
        self._accepted: dict[int, int] = {}  # by how many servers, of goals not yet forgotten
        self._asks: OrderedDict[bytes, None] = OrderedDict()
        self._outdated: set[int] = set()
        self._asking = False
        self._questions: deque[int] = deque(maxlen=_QUESTIONS)
        self.cancel_window = runtime.cancel_window(action_name)
        self._cancels = CancelQueue(
            runtime,
            self.cancel_window,
            send=self._ask_cancel_now,
            cancel_timer=runtime.cancel_timer,
        )
        self._orphans = OrphanedGoals(
            runtime,
            action_name,
            window=self.cancel_window,
            count_servers=count_servers,
            cancel=self._send_cancel,
            on_change=self._on_orphans_changed,
        )
        self.on_orphans_gone: Callable[[], None] = lambda: None
        """Called when `cancels_orphans` may have become false."""
        unanswered, orphans = self._unanswered, self._orphans
        self._answers: dict[str, tuple[Source, tuple[Sized, ...]]] = {
            "goal": (entities.goal, (unanswered["goal"],)),
            "result": (entities.result, (unanswered["result"],)),
            "cancel": (entities.cancel, (unanswered["cancel"], self._questions, orphans.asked)),
        }  # and what makes them wanted
        self.unheard_since: float | None = None
        """When the first question or cancel request was sent after the last answer to one."""

    # --- sending ---------------------------------------------------------------------------

    def send_goal(self, key: bytes, goal: Any) -> None:
        """Send a goal.

        Args:
            key: Its id.
            goal: The action's goal message.

        Raises:
            Exception: Whatever rclpy's converters raise. Then nothing was sent.
        """
        request = self._impl.SendGoalService.Request()
        request.goal_id = _to_uuid(key)
        request.goal = goal
        seq = self._entities.goal.send(request)
        self._made.setdefault(key, [])
        self._register("goal", key, seq)

    def ask_result(self, key: bytes, *, supersedes_earlier: bool = False) -> None:
        """Ask for a sent goal's result; again only at a measured pace.

        Hundreds of goals that ask again at the same moment would overrun the server's queue
        (R3), and lose what they ask for.

        Args:
            key: The goal's id.
            supersedes_earlier: Whether what was asked so far is outdated: see `is_outdated`.
        """
        if key not in self._made:
            return
        asked = [seq for what, seq in self._made[key] if what == "result"]
        if supersedes_earlier:
            self._outdated.update(seq for seq in asked if self.awaits("result", seq))
        if supersedes_earlier or not asked:
            self._send_ask(key)
            return
        self._asks[key] = None
        self._ask_soon()

    def ask_cancel(self, key: bytes, *, urgent: bool = False) -> None:
        """Ask for a sent goal's cancellation, when it is its turn, until that is answered.

        Args:
            key: The goal's id.
            urgent: Whether its caller has little time left.
        """
        if key in self._made:
            self._cancels.ask(key, urgent=urgent)

    def stop_cancel(self, key: bytes) -> None:
        """Ask for its cancellation no more, for now: its server is gone."""
        self._cancels.forget(key)

    def cancel_answered(self, seq: int, *, known: bool) -> bytes | None:
        """Count a cancel request as answered; return its goal's id if anybody waits for it.

        Args:
            seq: The request's number.
            known: Whether the server knows the goal.
        """
        key = self.answered("cancel", seq)
        if key is not None:
            self._cancels.answered(key, known=known)
        return key

    def question(self) -> int:
        """Ask what every live server answers, and what changes nothing (R2).

        Returns:
            The sequence number that each answer will carry.
        """
        seq = self._send_cancel(uuid.uuid4().bytes)
        self._questions.append(seq)
        self._sync("cancel")
        return seq

    def forget(self, key: bytes, *, abandoned: bool, finished: bool) -> None:
        """Free what a sent goal's requests hold (R16).

        Args:
            key: The goal's id.
            abandoned: Whether it is to be left running on purpose. Else it is cancelled where
                another server runs it (R14).
            finished: Whether a server has told its result.
        """
        self._asks.pop(key, None)
        self._cancels.forget(key)
        accepted: dict[int, int] = {}
        for what, seq in self._made.pop(key, ()):
            self._unanswered[what].pop(seq, None)
            if what == "result":
                self._outdated.discard(seq)
            elif what == "goal":
                accepted[seq] = self._accepted.pop(seq, 0)
        if not abandoned:
            # Where packets are lost, an acceptance may come after the result.
            acceptance_pending = finished and not any(accepted.values())
            for seq, servers in accepted.items():
                self._orphans.ended(
                    seq, key, accepted=servers, acceptance_pending=acceptance_pending
                )
        for what in self._unanswered:
            self._sync(what)

    def server_came(self) -> None:
        """A server is ready that was not: it may run goals that have ended here (R14)."""
        self._orphans.server_came()
        self._sync("goal")

    @property
    def cancels_orphans(self) -> bool:
        """Whether goals that ended here are being cancelled elsewhere, where they surely are."""
        return self._orphans.confirmed

    def close(self) -> None:
        """Send nothing any more."""
        self._closed = True
        self._cancels.close()
        self._orphans.close()

    def _ask_soon(self) -> None:
        if self._asks and not self._asking:
            self._asking = True
            self._runtime.call_at(self._runtime.now() + _ASK_PAUSE, self._ask_next)

    def _ask_next(self) -> None:
        self._asking = False
        if self._closed:
            return
        for _ in range(min(_ASKS_AT_ONCE, len(self._asks))):
            self._send_ask(self._asks.popitem(last=False)[0])
        self._ask_soon()

    def _send_ask(self, key: bytes) -> None:
        if key not in self._made:
            return
        request = self._impl.GetResultService.Request()
        request.goal_id = _to_uuid(key)
        self._register("result", key, self._entities.result.send(request))

    def _ask_cancel_now(self, key: bytes) -> None:
        self._register("cancel", key, self._send_cancel(key))
        self._on_cancel_sent(key)

    def _send_cancel(self, key: bytes) -> int:
        if self.unheard_since is None:
            self.unheard_since = self._runtime.now()
        request = CancelGoal.Request()
        request.goal_info.goal_id = _to_uuid(key)
        return self._entities.cancel.send(request)

    def _register(self, what: str, key: bytes, seq: int) -> None:
        self._unanswered[what][seq] = key
        self._made[key].append((what, seq))
        self._sync(what)

    # --- answers ---------------------------------------------------------------------------

    def awaits(self, what: str, seq: int) -> bool:
        """Whether a request (`"goal"`, `"result"`, `"cancel"`) is unanswered."""
        return seq in self._unanswered[what]

    def goal_of(self, what: str, seq: int) -> bytes:
        """Return the id of the goal that an unanswered request is about, or nothing."""
        return self._unanswered[what].get(seq, b"")

    def answered(self, what: str, seq: int) -> bytes | None:
        """Count a request as answered; return its goal's id, or `None` if nobody waits for it."""
        if what == "result":
            self._outdated.discard(seq)
        key = self._unanswered[what].pop(seq, None)
        self._sync(what)
        return key

    def is_outdated(self, seq: int) -> bool:
        """Whether more has become known of a goal since its result was asked for.

        A server that did not know the goal then may know it now, and its answer may be held up on
        the way until long after the acceptance.
        """
        return seq in self._outdated

    def goal_answered(self, seq: int, *, accepted: bool) -> bytes | None:
        """Count a goal request as answered; return its goal's id where nobody had done so."""
        key = self.answered("goal", seq)
        if not accepted:
            return key
        if key is None and seq not in self._accepted:
            self._orphans.accepted_late(seq)
        else:
            self._accepted[seq] = self._accepted.get(seq, 0) + 1
        return key

    def orphan_answered(self, seq: int, canceling: Collection[bytes], *, over: bool) -> None:
        """A server has answered a cancel request that may be about a goal that ended here.

        Args:
            seq: The request's number.
            canceling: The ids of the goals that it cancels now.
            over: Whether it says that the goal ends or has ended already.
        """
        self._orphans.answered(seq, canceling, over=over)

    def heard(self) -> None:
        """Somebody has answered a question or a cancel request, or nobody is left to do so."""
        self.unheard_since = None

    def is_question(self, seq: int) -> bool:
        """Whether it is the sequence number of a question, of which answers count."""
        return seq in self._questions

    def forget_questions(self) -> None:
        """Wait for no more answers to them."""
        self._questions.clear()
        self._sync("cancel")

    # --- waiting ---------------------------------------------------------------------------

    def _sync(self, what: str) -> None:
        """Wait for answers that are wanted, and for no others: an idle client costs no turn."""
        source, wanted = self._answers[what]
        if any(wanted) or (what == "goal" and self._orphans.awaited):
            self._runtime.enable(source)
        else:
            self._runtime.disable(source)

    def _on_orphans_changed(self) -> None:
        self._sync("cancel")
        if not self._orphans.confirmed:
            self.on_orphans_gone()

    def table_sizes(self) -> dict[str, int]:
        """Return how many entries each table holds."""
        sizes = {what: len(table) for what, table in self._unanswered.items()}
        return {
            **sizes,
            "sent": len(self._made),
            "accepted": len(self._accepted),
            "asks": len(self._asks) + len(self._outdated),
            "cancels": len(self._cancels),
            "orphans": len(self._orphans) + len(self._orphans.asked),
        }


@lru_cache(_UUIDS)  # each goal has two requests at least; nobody changes their ids
def _to_uuid(key: bytes) -> UUID:
    return UUID(uuid=list(key))

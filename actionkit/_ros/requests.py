"""The requests that one client makes of the servers, and whose each of them is.

All of it happens on the communication thread. A response cannot be taken before its request
is registered (R7), because the same thread sends and takes.
"""

from __future__ import annotations

import uuid
from collections import OrderedDict, deque
from collections.abc import Sized
from functools import lru_cache
from typing import Any

from action_msgs.srv import CancelGoal
from unique_identifier_msgs.msg import UUID

from actionkit._ros.entities import Entities
from actionkit._ros.native import Source
from actionkit._ros.runtime import Runtime

_REMEMBERED = 256
_QUESTIONS = 64
_ASKS_AT_ONCE = 4
_ASK_PAUSE = 0.01
"""Seconds between two handfuls of questions that were asked before."""


class Requests:
    """Sends requests, and knows the goal of each that is unanswered."""

    def __init__(self, runtime: Runtime, entities: Entities, impl: Any) -> None:
        """Send nothing so far.

        Args:
            runtime: Whose thread this is.
            entities: What sends.
            impl: The action type's `Impl`.
        """
        self._runtime = runtime
        self._entities = entities
        self._impl = impl
        self._closed = False
        self._unanswered: dict[str, dict[int, bytes]] = {"goal": {}, "result": {}, "cancel": {}}
        self._made: dict[bytes, list[tuple[str, int]]] = {}
        self._asks: OrderedDict[bytes, None] = OrderedDict()
        self._outdated: set[int] = set()
        self._asking = False
        self._questions: deque[int] = deque(maxlen=_QUESTIONS)
        self._ended: OrderedDict[int, bytes] = OrderedDict()
        self._answers: dict[str, tuple[Source, tuple[Sized, ...]]] = {
            "goal": (entities.goal, (self._unanswered["goal"], self._ended)),
            "result": (entities.result, (self._unanswered["result"],)),
            "cancel": (entities.cancel, (self._unanswered["cancel"], self._questions)),
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

    def ask_result(self, key: bytes, *, anew: bool = False) -> None:
        """Ask for a sent goal's result; again only at a measured pace.

        Hundreds of goals that ask again at the same moment would overrun the server's queue
        (R3), and lose what they ask for.

        Args:
            key: The goal's id.
            anew: Whether what was asked so far is outdated: see `is_outdated`.
        """
        if key not in self._made:
            return
        asked = [seq for what, seq in self._made[key] if what == "result"]
        if anew:
            self._outdated.update(seq for seq in asked if self.awaits("result", seq))
        if anew or not asked:
            self._send_ask(key)
            return
        self._asks[key] = None
        self._ask_soon()

    def ask_cancel(self, key: bytes) -> None:
        """Ask for a sent goal's cancellation."""
        if key in self._made:
            self._register("cancel", key, self._send_cancel(key))

    def question(self) -> int:
        """Ask what every live server answers, and what changes nothing (R2).

        Returns:
            The sequence number that each answer will carry.
        """
        seq = self._send_cancel(uuid.uuid4().bytes)
        self._questions.append(seq)
        self._sync("cancel")
        return seq

    def forget(self, key: bytes, *, elsewhere: bool) -> None:
        """Free what a sent goal's requests hold (R16).

        Args:
            key: The goal's id.
            elsewhere: Whether another server may be running it, and is to be told not to (R14).
        """
        self._asks.pop(key, None)
        made = self._made.pop(key, ())
        for what, seq in made:
            self._unanswered[what].pop(seq, None)
            if what == "result":
                self._outdated.discard(seq)
        if elsewhere:
            self._ended.update((seq, key) for what, seq in made if what == "goal")
            while len(self._ended) > _REMEMBERED:
                self._ended.popitem(last=False)
            self._send_cancel(key)
        for what in self._unanswered:
            self._sync(what)

    def close(self) -> None:
        """Send nothing any more."""
        self._closed = True

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

    def answered_late(self, seq: int, *, accepted: bool) -> None:
        """A second server has answered: cancel there what ended on the first (R14)."""
        ended = self._ended.pop(seq, None)
        self._sync("goal")
        if ended is not None and accepted:
            self._send_cancel(ended)

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
        if any(wanted):
            self._runtime.enable(source)
        else:
            self._runtime.disable(source)

    def table_sizes(self) -> dict[str, int]:
        """Return how many entries each table holds."""
        sizes = {what: len(table) for what, table in self._unanswered.items()}
        return {**sizes, "sent": len(self._made), "asks": len(self._asks) + len(self._outdated)}


@lru_cache(_REMEMBERED)  # each goal has two requests at least; nobody changes their ids
def _to_uuid(key: bytes) -> UUID:
    return UUID(uuid=list(key))

"""Sends the service requests of one client, and knows which goal each answer is about.

All of it happens on the communication thread. No response can be taken before its request is
registered (R7), because the same thread sends and takes.
"""

from __future__ import annotations

import uuid
from collections import OrderedDict, deque
from collections.abc import Callable, Sized
from functools import lru_cache
from typing import Any, NamedTuple

from action_msgs.srv import CancelGoal
from unique_identifier_msgs.msg import UUID

from actionkit._model.cancel_answer import CancelAnswer
from actionkit._ros.cancels import CancelQueue, CancelWindow
from actionkit._ros.entities import Entities
from actionkit._ros.native import Source
from actionkit._ros.orphans import OrphanedGoals
from actionkit._ros.runtime import Runtime
from actionkit._ros.servers.readiness import UNNAMED

_UUIDS = 64
"""Messages kept; several times as many as there are requests on their way."""
_PROBES = 64
"""Probes with answers that still count; many more than are sent while one is unanswered."""
_ASKS_AT_ONCE = 4
"""Repeated result requests; half of what a server's queue holds (R3), as others ask too."""
_ASK_PAUSE = 0.01
"""Seconds between two such groups; a server that lives has answered the group before by then."""


class Answered(NamedTuple):
    """What an answer is about. Every server on the name answers every request; none says which.

    Attributes:
        key: The goal's id, or `None` if the request was not ours.
        sent_at: When the request was sent.
        everybody: Whether each server in sight has answered it by now.
        knowing: How many of them have told that the goal has ended; of a request to cancel it, how
            many know the goal.
    """

    key: bytes | None = None
    sent_at: float = 0.0
    everybody: bool = False
    knowing: int = 0


class ServiceRequests:
    """Sends requests for goals, results and cancellations, and matches the answers."""

    def __init__(
        self,
        runtime: Runtime,
        entities: Entities,
        impl: Any,
        *,
        action_name: str,
        count_servers: Callable[[], int],
        servers: Callable[[], frozenset[bytes]],
        on_cancel_sent: Callable[[bytes], None],
    ) -> None:
        """Make them. Sends nothing yet.

        Args:
            runtime: All this happens on its thread.
            entities: What sends.
            impl: The action type's `Impl`.
            action_name: For the log.
            count_servers: Returns how many servers are in sight.
            servers: Returns their ids.
            on_cancel_sent: Called with a goal's id after each request to cancel it.
        """
        self._runtime = runtime
        self._entities = entities
        self._impl = impl
        self._count_servers = count_servers
        self._servers = servers
        self._on_cancel_sent = on_cancel_sent
        self._closed = False
        self._unanswered: dict[str, dict[int, tuple[bytes, float, frozenset[bytes]]]] = {
            "goal": {},
            "result": {},
            "cancel": {},
        }
        """The goal of each request, when it was sent, and to which servers; by kind and number."""
        self._heard: dict[tuple[str, int], tuple[int, int]] = {}
        """How many servers have answered, and how many of them know the goal, while others have not
        answered yet."""
        self._made: dict[bytes, list[tuple[str, int]]] = {}  # all requests of each goal
        self._accepted: dict[int, tuple[bytes, int]] = {}
        """The goal of each request that was accepted, and by how many servers; until forgotten."""
        self._asks: OrderedDict[bytes, None] = OrderedDict()  # results to be asked for again
        self._asking = False
        self._outdated: set[int] = set()
        self._probes: deque[int] = deque(maxlen=_PROBES)
        self.unheard_since: float | None = None
        """When the first probe or cancel request was sent after the last answer to one."""
        self.cancel_window = runtime.window(CancelWindow, action_name)
        self.cancels = CancelQueue(
            runtime,
            self.cancel_window,
            send=self._send_goal_cancel,
            cancel_timer=runtime.cancel_timer,
        )
        self.orphans = OrphanedGoals(
            runtime,
            action_name,
            window=self.cancel_window,
            count_servers=count_servers,
            cancel=self._send_cancel,
            on_change=lambda: self._sync("cancel"),
        )
        unanswered = self._unanswered
        self._wanted: dict[str, tuple[Source, tuple[Sized, ...]]] = {
            "goal": (entities.goal, (unanswered["goal"],)),
            "result": (entities.result, (unanswered["result"],)),
            "cancel": (
                entities.cancel,
                (unanswered["cancel"], self._probes, self.orphans.requests),
            ),
        }
        """The source of each kind of answer, and the tables that make it wanted."""

    # --- sending ---------------------------------------------------------------------------

    def send_goal(self, key: bytes, goal: Any) -> None:
        """Send a goal.

        Args:
            key: Its id.
            goal: The action's goal message.

        Raises:
            Exception: Anything that rclpy's converters raise. Then nothing was sent.
        """
        request = self._impl.SendGoalService.Request()
        request.goal_id = _to_uuid(key)
        request.goal = goal
        seq = self._entities.goal.send(request)
        self._made.setdefault(key, [])
        self._register("goal", key, seq)

    def ask_result(self, key: bytes, *, supersedes_earlier: bool = False) -> None:
        """Ask for a sent goal's result; at once the first time, later at a limited rate.

        Hundreds of goals that ask again at the same moment would overrun the server's queue
        (R3), and lose what they ask for.

        Args:
            key: The goal's id.
            supersedes_earlier: Whether earlier requests are outdated (see `is_outdated`). Then
                this one is sent at once.
        """
        if key not in self._made:
            return
        asked = [seq for what, seq in self._made[key] if what == "result"]
        if supersedes_earlier:
            self._outdated.update(seq for seq in asked if self.goal_of("result", seq))
        if supersedes_earlier or not asked:
            self._send_ask(key)
            return
        self._asks[key] = None
        self._ask_soon()

    def probe(self) -> int:
        """Ask to cancel a goal that cannot exist: every live server answers, nothing changes (R2).

        Returns:
            The sequence number that each answer will carry.
        """
        seq = self._send_cancel(uuid.uuid4().bytes)
        self._probes.append(seq)
        self._sync("cancel")
        return seq

    def forget(self, key: bytes, *, abandoned: bool, finished: bool) -> None:
        """Free what a sent goal's requests hold (R16).

        Args:
            key: The goal's id.
            abandoned: Whether it is to be left running on purpose. Otherwise it is cancelled where
                another server runs it (R14).
            finished: Whether a server has told its result.
        """
        self._asks.pop(key, None)
        self.cancels.stop(key)
        accepted: dict[int, int] = {}
        for what, seq in self._made.pop(key, ()):
            self._unanswered[what].pop(seq, None)
            self._heard.pop((what, seq), None)
            if what == "result":
                self._outdated.discard(seq)
            elif what == "goal":
                accepted[seq] = self._accepted.pop(seq, (b"", 0))[1]
        if not abandoned:
            # Where packets are lost, an acceptance may come after the result.
            pending = finished and not any(accepted.values())
            for seq, servers in accepted.items():
                self.orphans.ended(seq, key, accepted=servers, pending=pending)
        for what in self._unanswered:
            self._sync(what)

    def server_came(self) -> None:
        """Handle that a server is ready that was not: goals that ended here may run on it (R14)."""
        self.orphans.server_came()
        self._sync("goal")

    def close(self) -> None:
        """Send nothing any more."""
        self._closed = True
        self.cancels.close()
        self.orphans.close()

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
        request = self._impl.GetResultService.Request()
        request.goal_id = _to_uuid(key)
        self._register("result", key, self._entities.result.send(request))

    def _send_goal_cancel(self, key: bytes) -> None:
        self._register("cancel", key, self._send_cancel(key))
        self._on_cancel_sent(key)

    def _send_cancel(self, key: bytes) -> int:
        if self.unheard_since is None:
            self.unheard_since = self._runtime.now()
        request = CancelGoal.Request()
        request.goal_info.goal_id = _to_uuid(key)
        return self._entities.cancel.send(request)

    def _register(self, what: str, key: bytes, seq: int) -> None:
        self._unanswered[what][seq] = key, self._runtime.now(), self._servers()
        self._made[key].append((what, seq))
        self._sync(what)

    # --- answers ---------------------------------------------------------------------------

    def goal_of(self, what: str, seq: int) -> bytes:
        """Return the id of the goal that an unanswered request is about; `b""` if there is none.

        Args:
            what: `"goal"`, `"result"` or `"cancel"`.
            seq: The request's number.
        """
        return self._unanswered[what].get(seq, (b"",))[0]

    def answered(self, what: str, seq: int, *, knows: bool = False) -> Answered:
        """Count an answer, and remove the request when each server in sight has answered.

        Args:
            what: `"goal"`, `"result"` or `"cancel"`.
            seq: The request's number.
            knows: Whether the answer counts for `Answered.knowing`.
        """
        request = self._unanswered[what].get(seq)
        if request is None:
            return Answered()
        key, sent_at, servers = request
        heard, knowing = self._heard.get((what, seq), (0, 0))
        heard, knowing = heard + 1, knowing + knows
        # Servers that have no names yet count as one.
        expected = max(len((servers | self._servers()) - UNNAMED), self._count_servers())
        everybody = heard >= expected
        if everybody:
            del self._unanswered[what][seq]
            self._heard.pop((what, seq), None)
            if what == "result":
                self._outdated.discard(seq)
            self._sync(what)
        else:
            self._heard[what, seq] = heard, knowing
        return Answered(key, sent_at, everybody, knowing)

    def is_outdated(self, seq: int) -> bool:
        """Whether more has become known of a goal since its result was asked for.

        A server that did not know the goal then may know it now, and its answer may be held up on
        the way until long after the acceptance.
        """
        return seq in self._outdated

    def goal_answered(self, seq: int, *, accepted: bool) -> bytes | None:
        """Count the answer to a goal request.

        Args:
            seq: The request's number.
            accepted: Whether the server accepted the goal.

        Returns:
            The goal's id, or `None` if it was forgotten.
        """
        key = self.answered("goal", seq).key
        if not accepted:
            return key
        before, servers = self._accepted.get(seq, (key, 0))
        if before is None:
            self.orphans.accepted_late(seq)
        else:
            self._accepted[seq] = before, servers + 1
        return before

    def cancel_answered(
        self, seq: int, answer: CancelAnswer, *, elsewhere: bool = False
    ) -> Answered:
        """Count the answer to a cancel request.

        Args:
            seq: The request's number.
            answer: What the server says about the goal.
            elsewhere: Whether that says nothing until each server has answered so.
        """
        known = answer is not CancelAnswer.UNKNOWN_GOAL
        answered = self.answered("cancel", seq, knows=known)
        if elsewhere and answered.knowing:  # what the other one said counts
            answered = Answered(answered.key, answered.sent_at, False, answered.knowing)
        if answered.key is not None and (answered.everybody or not elsewhere):
            self.cancels.answered(answered.key, answer, answered.sent_at)
        return answered

    def probe_answered(self, seq: int, *, others_matter: bool) -> bool:
        """Return whether an answer is to a probe.

        Args:
            seq: The request's number.
            others_matter: Whether the answers of other servers are to be waited for.
        """
        if seq not in self._probes:
            return False
        if not others_matter:
            self._probes.clear()
            self._sync("cancel")
        return True

    def heard(self) -> None:
        """Note that a cancel request was answered, or that nobody is left who could answer."""
        self.unheard_since = None

    # --- waiting ---------------------------------------------------------------------------

    def _sync(self, what: str) -> None:
        """Wait for answers that are wanted, and for no others: an idle client never wakes up."""
        source, wanted = self._wanted[what]
        if any(wanted) or (what == "goal" and self.orphans.awaited):
            self._runtime.enable(source)
        else:
            self._runtime.disable(source)

    def table_sizes(self) -> dict[str, int]:
        """Return how many entries each table holds."""
        sizes = {what: len(table) for what, table in self._unanswered.items()}
        return {
            **sizes,
            "sent": len(self._made),
            "heard": len(self._heard),
            "accepted": len(self._accepted),
            "asks": len(self._asks) + len(self._outdated),
            "cancels": len(self.cancels),
            "orphans": len(self.orphans) + len(self.orphans.requests),
        }


@lru_cache(_UUIDS)  # each goal has at least two requests, and nobody changes a message's id
def _to_uuid(key: bytes) -> UUID:
    return UUID(uuid=list(key))

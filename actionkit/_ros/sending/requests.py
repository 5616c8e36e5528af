"""Sends the service requests of one client, and finds the goal that an answer is about.

All of it happens on the communication thread. The same thread sends requests and reads responses,
so no response can be read before its request is registered (R7).
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
from actionkit._ros.cancelling.cancels import CancelQueue, CancelWindow
from actionkit._ros.communication.runtime import Runtime
from actionkit._ros.endpoints.entities import Entities
from actionkit._ros.rclpy_private.wait_set import Source
from actionkit._ros.servers_in_sight.readiness import UNNAMED

_UUIDS = 64
"""Cached messages; several times as many as there are requests on their way."""
_PROBES = 64
"""Probes that answers are matched with; many more than are unanswered at one time."""
_ASKS_AT_ONCE = 4
"""Repeated result requests at once: half of a server's queue (R3), because others ask, too."""
_ASK_PAUSE = 0.01
"""Seconds between two such groups; a live server has answered the earlier group by then."""
_REMEMBERED = 64
"""Released goals that another server may still accept: the newest. A server that is busy keeps only
10 requests (R3)."""


class Answered(NamedTuple):
    """What an answer is about. It does not say which of several servers has sent it."""

    key: bytes | None = None  # the goal's id, or `None` if the request was not ours
    sent_at: float = 0.0
    everybody: bool = False  # whether each server in sight has answered it by now
    knowing: int = 0  # how many say that the goal has ended or, for a cancel, know the goal
    answers: int = 0  # how many servers have answered it by now


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

        `count_servers` and `servers` return how many servers are in sight, and their ids.
        `on_cancel_sent` gets a goal's id after each request to cancel it.
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
        """For each request, by kind and number: the goal, when it was sent, and to which
        servers."""
        self._heard: dict[tuple[str, int], tuple[int, int]] = {}
        """How many servers have answered a request, and how many of these know the goal, while
        other servers have not answered yet."""
        self._made: dict[bytes, list[tuple[str, int]]] = {}  # all requests of each goal
        self._sent: dict[int, bytes] = {}
        """For each goal request: the goal, until it is forgotten."""
        self._released: OrderedDict[int, Any] = OrderedDict()
        """For each goal request: what was given to `forget` about its goal."""
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
        unanswered = self._unanswered
        self._wanted: dict[str, tuple[Source, tuple[Sized, ...]]] = {
            "goal": (entities.goal, (unanswered["goal"],)),
            "result": (entities.result, (unanswered["result"],)),
            "cancel": (entities.cancel, (unanswered["cancel"], self._probes)),
        }
        """Kind of answer -> its source, and the tables that say whether answers are awaited."""

    # --- sending ---------------------------------------------------------------------------

    def send_goal(self, key: bytes, goal: Any) -> None:
        """Send a goal. If rclpy's converters raise, nothing was sent."""
        request = self._impl.SendGoalService.Request()
        request.goal_id = _to_uuid(key)
        request.goal = goal
        seq = self._entities.goal.send(request)
        self._made.setdefault(key, [])
        self._register("goal", key, seq)
        self._sent[seq] = key

    def follow(self, key: bytes, request: int | None = None) -> None:
        """Allow requests about a goal that somebody else has sent.

        With `request`, it was sent here by the request with this number, and was forgotten.
        """
        made = self._made.setdefault(key, [])
        if request is not None:
            made.append(("goal", request))
            self._sent[request] = key

    def ask_result(self, key: bytes, *, supersedes_earlier: bool = False) -> None:
        """Ask for a sent goal's result; at once the first time, later at a limited rate.

        If hundreds of goals asked again at the same moment, they would overrun the server's queue
        (R3), and the answers would be lost. `supersedes_earlier` means that earlier requests are
        outdated (see `is_outdated`); then this request is sent at once.
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

        Return the sequence number that each answer will have.
        """
        seq = self._send_cancel(uuid.uuid4().bytes)
        self._probes.append(seq)
        self._sync("cancel")
        return seq

    def forget(self, key: bytes, keep: Any = None) -> None:
        """Free what a sent goal's requests hold (R16).

        With `keep`, `released` returns that later: another server may still accept the goal (R14).
        """
        self._asks.pop(key, None)
        self.cancels.stop(key)
        for what, seq in self._made.pop(key, ()):
            self._unanswered[what].pop(seq, None)
            self._heard.pop((what, seq), None)
            if what == "result":
                self._outdated.discard(seq)
            elif what == "goal":
                del self._sent[seq]
                if keep is not None:
                    self._released[seq] = keep
        if len(self._released) > _REMEMBERED:
            self._released.popitem(last=False)
        for what in self._unanswered:
            self._sync(what)

    def released(self, seq: int) -> Any:
        """Return what `forget` kept about the goal of this request, once; else `None`."""
        return self._released.pop(seq, None)

    def server_came(self) -> None:
        """Handle that a new server is ready: it may have accepted goals that ended here (R14)."""
        self._sync("goal")

    def close(self) -> None:
        """Send nothing more."""
        self._closed = True
        self.cancels.close()

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
        """Return the goal's id for an unanswered request; `b""` if there is no such request."""
        return self._unanswered[what].get(seq, (b"",))[0]

    def answered(self, what: str, seq: int, *, knows: bool = False) -> Answered:
        """Count an answer, and remove the request when each server in sight has answered.

        `what` is `"goal"`, `"result"` or `"cancel"`. `knows` adds the answer to `Answered.knowing`.
        """
        request = self._unanswered[what].get(seq)
        if request is None:
            return Answered()
        key, sent_at, servers = request
        heard, knowing = self._heard.get((what, seq), (0, 0))
        heard, knowing = heard + 1, knowing + knows
        # All servers without a name count as one.
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
        return Answered(key, sent_at, everybody, knowing, heard)

    def is_outdated(self, seq: int) -> bool:
        """Whether more has become known of a goal since its result was asked for.

        At that time, a server may not have known the goal, and such an answer may arrive long after
        the acceptance.
        """
        return seq in self._outdated

    def goal_answered(self, seq: int, *, accepted: bool) -> bytes | None:
        """Count the answer to a goal request; return the goal's id, `None` if it was forgotten.

        A server that is not in sight yet may accept a goal after all others have answered.
        """
        key = self.answered("goal", seq).key
        return self._sent.get(seq) if accepted else key

    def cancel_answered(
        self, seq: int, answer: CancelAnswer, *, elsewhere: bool = False
    ) -> Answered:
        """Count the answer to a cancel request.

        `elsewhere` means that this answer counts only when each server has answered in the same
        way.
        """
        known = answer is not CancelAnswer.UNKNOWN_GOAL
        answered = self.answered("cancel", seq, knows=known)
        if elsewhere and answered.knowing:  # the other server's answer counts
            answered = Answered(answered.key, answered.sent_at, False, answered.knowing)
        if answered.key is not None and (answered.everybody or not elsewhere):
            self.cancels.answered(answered.key, answer, answered.sent_at)
        return answered

    def probe_answered(self, seq: int, *, others_matter: bool) -> bool:
        """Return whether an answer is to a probe; `others_matter`: wait for other servers, too."""
        if seq not in self._probes:
            return False
        if not others_matter:
            self._probes.clear()
            self._sync("cancel")
        return True

    def heard(self) -> None:
        """Record that a cancel request was answered, or that no server is left to answer."""
        self.unheard_since = None

    # --- waiting ---------------------------------------------------------------------------

    def _sync(self, what: str) -> None:
        """Wait only for answers that are wanted: so an idle client never wakes up."""
        source, wanted = self._wanted[what]
        late = what == "goal" and bool(self._released) and self._count_servers() > 1
        if late or any(wanted):
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
            "goals sent": len(self._sent),
            "asks": len(self._asks) + len(self._outdated),
            "cancels": len(self.cancels),
        }


@lru_cache(_UUIDS)  # each goal has at least two requests, and nobody changes a message's id
def _to_uuid(key: bytes) -> UUID:
    return UUID(uuid=list(key))

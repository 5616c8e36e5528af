"""What ties one client to the servers of one action: who asked what, and who is told.

All of it happens on the communication thread. A response cannot be taken before its request
is registered (R7), because the same thread sends and takes.
"""

from __future__ import annotations

import logging
import uuid
from collections import OrderedDict, deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Protocol

from action_msgs.srv import CancelGoal
from rclpy.exceptions import InvalidHandle
from unique_identifier_msgs.msg import UUID

from actionkit._ros import graph
from actionkit._ros.entities import Entities
from actionkit._ros.liveness import Liveness
from actionkit._ros.native import RCLError, ResponseSource, Source
from actionkit._ros.outbox import Outbox
from actionkit._ros.presence import Presence
from actionkit._ros.rollcall import RollCall
from actionkit._ros.runtime import Runtime
from actionkit._ros.status import StatusWatch
from actionkit._ros.wire import feedback_goal_id

_log = logging.getLogger("actionkit")
_REMEMBERED = 256
_NAMING = 0.5
"""Seconds until the graph knows the nodes of servers that it has just discovered."""
_ASKS_AT_ONCE = 4
_ASK_PAUSE = 0.01
"""Seconds between two handfuls of questions that were asked before."""


class GoalListener(Protocol):
    """Who is told what the servers say of one goal."""

    goal_id: uuid.UUID

    @property
    def unwanted(self) -> bool: ...
    def on_server_ready(self) -> None: ...
    def on_type_mismatch(self, served: tuple[str, ...]) -> None: ...
    def on_sent(self) -> None: ...
    def on_send_failed(self, error: Exception) -> None: ...
    def on_accepted(self) -> None: ...
    def on_rejected(self) -> None: ...
    def on_feedback(self, message: bytes) -> None: ...
    def on_status(self, status: int) -> None: ...
    def on_result(self, status: int, result: Any) -> None: ...
    def on_cancel_answer(self, code: int, ours_is_canceling: bool) -> None: ...
    def on_server_lost(self, reason: str) -> None: ...


@dataclass
class _Entry:
    """One goal that may be on a server, and the requests made for it."""

    listener: GoalListener
    servers: frozenset[bytes]
    seqs: dict[str, list[int]] = field(
        default_factory=lambda: {"goal": [], "result": [], "cancel": []}
    )


class Link:
    """The routing tables of one client over its entities."""

    def __init__(self, runtime: Runtime, action_type: Any, type_name: str, name: str) -> None:
        """Make the entities and look for servers. On the communication thread.

        Args:
            runtime: Whose thread and node to use.
            action_type: The action's class.
            type_name: Such as `test_msgs/action/Fibonacci`.
            name: The fully qualified action name.

        Raises:
            Exception: Whatever rclpy raises for a bad name or type.
        """
        self.name = name
        self.runtime = runtime
        self._impl = action_type.Impl
        self._closed = False
        self._warned = False
        self._entries: dict[bytes, _Entry] = {}
        self._outbox: Outbox[tuple[GoalListener, Any]] = Outbox()
        self._awaiting: dict[GoalListener, None] = {}
        self._rollcall = RollCall(runtime, self._ask_all, self._one_answers)
        self.liveness = Liveness(
            runtime,
            probe=self._ask_all,
            wanted=lambda: not self._closed and bool(self._entries or len(self._outbox)),
            on_silence=self._on_silence,
            on_return=self._on_return,
        )
        self._asks: OrderedDict[bytes, None] = OrderedDict()
        self._asking = False
        self._ready_waiters: dict[Callable[[], None], None] = {}
        self._pending: dict[str, dict[int, bytes]] = {"goal": {}, "result": {}, "cancel": {}}
        self._probes: deque[int] = deque(maxlen=64)
        self._ended: OrderedDict[int, bytes] = OrderedDict()
        self._entities = Entities(
            runtime.node,
            self._impl,
            name,
            on_goal=self._take_goal,
            on_result=self._take_result,
            on_cancel=self._take_cancel,
            on_feedback=self._take_feedback,
            on_matched=self._on_matched,
        )
        self._status = StatusWatch(runtime, self._entities, self._entries, self._take_status)
        self.presence = Presence(
            runtime,
            list_servers=self._list_servers,
            services_ready=self._services_ready,
            probe=self._ask_all,
            on_ready=self._on_ready,
            on_lost=self._on_lost,
            on_mismatch=self._on_mismatch,
            action_type=type_name,
        )
        if self._entities.matched is None:
            self._poll_matched()
        else:
            runtime.enable(self._entities.matched)

    # --- what goals ask for ----------------------------------------------------------------

    def await_server(self, listener: GoalListener) -> None:
        """Tell the listener once when a server is ready, or while another type is served."""
        if self.presence.ready:
            listener.on_server_ready()
            return
        self._awaiting[listener] = None
        self.presence.look(lambda: bool(self._awaiting))

    def hold(self, listener: GoalListener) -> None:
        """Tell the listener again when a server is ready anew."""
        self._awaiting[listener] = None

    def send_goal(self, listener: GoalListener, goal: Any) -> None:
        """Queue a goal request; the listener is told when it was sent."""
        self._awaiting.pop(listener, None)
        self._outbox.put(listener.goal_id.bytes, (listener, goal))
        self._flush()

    def adopt(self, listener: GoalListener) -> None:
        """Tell this listener what comes for its goal id, instead of the one before."""
        entry = self._entries.get(listener.goal_id.bytes)
        if entry is not None:
            entry.listener = listener

    def withdraw(self, listener: GoalListener) -> None:
        """Await and send nothing any more for the listener."""
        self._awaiting.pop(listener, None)
        self._outbox.discard(listener.goal_id.bytes)
        self._flush()

    def ask_result(self, listener: GoalListener) -> None:
        """Ask for the goal's result; again only at a measured pace.

        Hundreds of goals that ask again at the same moment would overrun the server's queue
        (R3), and lose what they ask for.
        """
        key = listener.goal_id.bytes
        entry = self._entries.get(key)
        if entry is None:
            return
        if not entry.seqs["result"]:
            self._send_ask(key)
            return
        self._asks[key] = None
        if not self._asking:
            self._asking = True
            self.runtime.call_at(self.runtime.now() + _ASK_PAUSE, self._ask_next)

    def _ask_next(self) -> None:
        self._asking = False
        for _ in range(min(_ASKS_AT_ONCE, len(self._asks))):
            self._send_ask(self._asks.popitem(last=False)[0])
        if self._asks and not self._closed:
            self._asking = True
            self.runtime.call_at(self.runtime.now() + _ASK_PAUSE, self._ask_next)

    def _send_ask(self, key: bytes) -> None:
        request = self._impl.GetResultService.Request()
        request.goal_id = _to_uuid(key)
        self._request("result", self._entities.result, request, key)

    def ask_cancel(self, listener: GoalListener) -> None:
        """Ask for the goal's cancellation."""
        request = _cancel_request(listener.goal_id.bytes)
        self._request("cancel", self._entities.cancel, request, listener.goal_id.bytes)

    def watch_status(self) -> None:
        """Tell all goals what the status topic says of them, while there are any."""
        self._status.start()

    def leave_outbox(self, listener: GoalListener) -> None:
        """Let the next goal request be sent: this one is answered, or is waited for no more."""
        self._outbox.discard(listener.goal_id.bytes)
        self._flush()

    def forget(self, listener: GoalListener, *, abandoned: bool) -> None:
        """Tell the listener nothing any more, and free what its goal held (R16).

        Args:
            listener: Whose goal it is.
            abandoned: Whether the goal is to be left running on purpose.
        """
        key = listener.goal_id.bytes
        self.withdraw(listener)
        self._asks.pop(key, None)
        entry = self._entries.pop(key, None)
        if entry is None:
            return
        for what, seqs in entry.seqs.items():
            for seq in seqs:
                self._pending[what].pop(seq, None)
        if self.presence.count > 1 and not abandoned:
            # The other server may still be running it (R14).
            for seq in entry.seqs["goal"]:
                self._ended[seq] = key
            while len(self._ended) > _REMEMBERED:
                self._ended.popitem(last=False)
            self._entities.cancel.send(_cancel_request(key))
        if not self._entries:
            self._status.stop()
        self._sync()

    def take_feedback_now(self) -> None:
        """Take the feedback that has come: it may be behind the result (R15)."""
        self._entities.feedback.take()

    # --- what clients ask for --------------------------------------------------------------

    def add_ready_waiter(self, callback: Callable[[], None]) -> None:
        """Call `callback` whenever a server becomes ready."""
        self._ready_waiters[callback] = None

    def remove_ready_waiter(self, callback: Callable[[], None]) -> None:
        """Undo `add_ready_waiter`."""
        self._ready_waiters.pop(callback, None)

    def table_sizes(self) -> dict[str, int]:
        """Return how many entries each table holds, for tests of growth (C7.5)."""
        sizes = {what: len(table) for what, table in self._pending.items()}
        return {
            **sizes,
            "goals": len(self._entries),
            "outbox": len(self._outbox) + len(self._asks),
            "awaiting": len(self._awaiting) + len(self._ready_waiters),
        }

    def close(self) -> None:
        """Destroy the entities. No listener is told anything any more."""
        self._closed = True
        self.presence.close()
        self._status.stop()
        for source in self._entities.sources:
            self.runtime.disable(source)
        self._entities.destroy()

    # --- sending ---------------------------------------------------------------------------

    def _flush(self) -> None:
        while self.presence.ready and (taken := self._outbox.take()) is not None:
            key, (listener, goal) = taken
            if listener.unwanted:
                self._outbox.discard(key)
                continue  # its cancellation is on the way to this thread
            request = self._impl.SendGoalService.Request()
            request.goal_id = _to_uuid(key)
            request.goal = goal
            entry = self._entries.get(key) or _Entry(listener, self.presence.servers)
            entry.listener = listener  # of the same goal, where it is sent again (R5)
            entry.servers = self.presence.servers
            try:
                seq = self._entities.goal.send(request)
            except Exception as error:  # noqa: BLE001  rclpy raises what its converters raise
                self._outbox.discard(key)
                listener.on_send_failed(error)
                continue
            self._entries[key] = entry
            self._pending["goal"][seq] = key
            entry.seqs["goal"].append(seq)
            self._sync()
            listener.on_sent()

    def _request(self, what: str, client: ResponseSource, request: Any, key: bytes) -> None:
        entry = self._entries.get(key)
        if entry is None:
            return
        seq = client.send(request)
        self._pending[what][seq] = key
        entry.seqs[what].append(seq)
        self._sync()

    def _ask_all(self) -> int:
        """Ask what every live server answers, and what changes nothing (R2)."""
        seq = self._entities.cancel.send(_cancel_request(uuid.uuid4().bytes))
        self._probes.append(seq)
        self._sync()
        return seq

    def _sync(self) -> None:
        """Wait for what is wanted, and for nothing else: an idle client costs no turn."""
        entities = self._entities
        self._want(entities.goal, bool(self._pending["goal"] or self._ended))
        self._want(entities.result, bool(self._pending["result"]))
        self._want(entities.cancel, bool(self._pending["cancel"] or self._probes))
        self._want(entities.feedback, bool(self._entries))

    def _want(self, source: Source, wanted: bool) -> None:
        if wanted:
            self.runtime.enable(source)
        else:
            self.runtime.disable(source)

    # --- what comes ------------------------------------------------------------------------

    def _take_goal(self, seq: int, response: Any) -> None:
        self.liveness.heard()
        key = self._pending["goal"].pop(seq, None)
        if key is None:
            ended = self._ended.pop(seq, None)
            if ended is not None and response.accepted:
                self._entities.cancel.send(_cancel_request(ended))
            self._sync()
            return
        listener = self._entries[key].listener
        if response.accepted:
            listener.on_accepted()
        else:
            listener.on_rejected()
        self._sync()

    def _take_result(self, seq: int, response: Any) -> None:
        self.liveness.heard()
        if response.status == 0 and self.presence.count > 1:
            # From a server that does not know the goal. Another may; or it was the goal's
            # server, and is dead (R1).
            if seq in self._pending["result"]:
                self._rollcall.begin()
            return
        key = self._pending["result"].pop(seq, None)
        if key is not None:
            self._entries[key].listener.on_result(response.status, response.result)
            self._sync()

    def _take_cancel(self, seq: int, response: Any) -> None:
        self.liveness.heard()
        self._rollcall.answered(seq)
        if seq in self._probes:
            if not self._rollcall.running:
                self._probes.clear()
            self.presence.answered()
        key = self._pending["cancel"].pop(seq, None)
        if key is not None:
            canceling = any(bytes(info.goal_id.uuid) == key for info in response.goals_canceling)
            self._entries[key].listener.on_cancel_answer(response.return_code, canceling)
        self._sync()

    def _take_feedback(self, message: bytes) -> None:
        entry = self._entries.get(feedback_goal_id(message))
        if entry is not None:
            self.liveness.heard()
            entry.listener.on_feedback(message)

    def _take_status(self, key: bytes, code: int) -> None:
        entry = self._entries.get(key)
        if entry is not None:
            entry.listener.on_status(code)

    # --- servers coming and going ----------------------------------------------------------

    def _on_matched(self, count: int) -> None:
        self.presence.matched(count)
        if count > 1 and not self._warned:
            self._warned = True
            # Their names are known a moment later.
            self.runtime.call_at(self.runtime.now() + _NAMING, self._warn_of_several)

    def _warn_of_several(self) -> None:
        servers = [] if self._closed else self._list_servers() or []
        if len(servers) > 1:
            _log.warning(
                "action %s has %d servers (%s): each of them runs every goal, and the first"
                " answer counts; after a restart the old one shows for up to 20 s",
                self.name,
                len(servers),
                ", ".join(server.node or "unnamed" for server in servers),
            )

    def _on_ready(self) -> None:
        awaiting, self._awaiting = self._awaiting, {}
        for listener in awaiting:
            listener.on_server_ready()
        for callback in list(self._ready_waiters):
            callback()
        for entry in list(self._entries.values()):
            entry.listener.on_server_ready()

    def _one_answers(self) -> None:
        """Of several servers one answers, and it does not know a goal of ours."""
        nodes = {server.gid: server.node for server in self._list_servers() or ()}
        for entry in list(self._entries.values()):
            newer = {nodes.get(gid, "") for gid in self.presence.servers - entry.servers} - {""}
            replaced = frozenset(gid for gid in entry.servers if nodes.get(gid) in newer)
            if replaced:
                self._lose(entry, replaced, "its server was restarted")
        if "" in nodes.values() and self._entries and not self._closed:
            # Nodes get their names some time after their endpoints.
            self.runtime.call_at(self.runtime.now() + _NAMING, self._rollcall.begin)

    def _on_silence(self, limit: float) -> None:
        for entry in list(self._entries.values()):
            entry.listener.on_server_lost(f"its server answered nothing for {limit:g} s")

    def _on_return(self) -> None:
        for entry in list(self._entries.values()):
            entry.listener.on_server_ready()

    def _on_lost(self, gone: frozenset[bytes]) -> None:
        for entry in list(self._entries.values()):
            self._lose(entry, gone, "its action server is gone")
        if not self.presence.servers:
            for listener, _ in self._outbox.waiting():
                listener.on_server_lost("its action server is gone")

    def _lose(self, entry: _Entry, gone: frozenset[bytes], reason: str) -> None:
        entry.servers -= gone
        if not entry.servers or not self.presence.servers:
            entry.listener.on_server_lost(reason)

    def _on_mismatch(self, served: tuple[str, ...]) -> None:
        for listener in list(self._awaiting):
            listener.on_type_mismatch(served)

    def _list_servers(self) -> list[graph.ServerInfo] | None:
        try:
            return graph.servers(self.runtime.node, self.name)
        except (RCLError, InvalidHandle):
            return None  # the context was shut down, and with it the graph (R10)

    def _services_ready(self) -> bool:
        try:
            return self._entities.services_ready()
        except (RCLError, InvalidHandle):
            return self.presence.count > 0

    def _poll_matched(self) -> None:
        """Where the middleware has no matched event: look once a second (C7.4)."""
        if self._closed:
            return
        listed = self._list_servers()
        if listed is not None and len(listed) != self.presence.count:
            self.presence.matched(len(listed))
        self.runtime.call_at(self.runtime.now() + 1.0, self._poll_matched)


def _to_uuid(key: bytes) -> UUID:
    return UUID(uuid=list(key))


def _cancel_request(key: bytes) -> CancelGoal.Request:
    request = CancelGoal.Request()
    request.goal_info.goal_id = _to_uuid(key)
    return request

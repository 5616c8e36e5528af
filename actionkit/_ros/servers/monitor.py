"""Who waits for the servers of one action, and who loses them.

What is known of the servers comes from `readiness`, `restarts` and `liveness`; here it is told to
the goals that it is about. All of it happens on the communication thread.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping

from rclpy.exceptions import InvalidHandle

from actionkit._ros import graph
from actionkit._ros.entities import Entities
from actionkit._ros.listener import GoalListener, SentGoal
from actionkit._ros.native import RCLError
from actionkit._ros.runtime import Runtime
from actionkit._ros.servers.liveness import Liveness
from actionkit._ros.servers.readiness import UNNAMED, ServerReadiness
from actionkit._ros.servers.restarts import RestartDetector
from actionkit._threads.clock import TimerGroup
from actionkit._threads.diagnostics import log_later

_NAMING = 0.5
"""Seconds until the graph knows the nodes of servers that it has just discovered."""
_MATCHED_PERIOD = 1.0
_IN_SIGHT_WITHIN = 0.5
"""Seconds from when requests reach a new server until it is in sight here, on a busy machine."""


class ServerMonitor:
    """Looks for servers, and tells the goals of those that come and go."""

    def __init__(
        self,
        runtime: Runtime,
        entities: Entities,
        *,
        name: str,
        type_name: str,
        ask: Callable[[], int],
        sent: Mapping[bytes, SentGoal],
        queued: Callable[[], list[GoalListener]],
        on_ready: Callable[[], None],
    ) -> None:
        """Begin to look.

        Args:
            runtime: Whose thread and node to use.
            entities: What sees the servers.
            name: The fully qualified action name.
            type_name: Such as `test_msgs/action/Fibonacci`.
            ask: Asks what every live server answers; returns the sequence number.
            sent: The goals that may be on a server, by id; read at each event.
            queued: Returns whose goals wait for their turn to be sent.
            on_ready: Called when goals can be sent to a server that has come.
        """
        self._runtime = runtime
        self._timers = TimerGroup(runtime, runtime.timers.cancel)
        self._entities = entities
        self._name = name
        self._sent = sent
        self._queued = queued
        self._tell_ready = on_ready
        self._closed = False
        self._warned = False
        self._awaiting: dict[GoalListener, None] = {}
        self._ready_waiters: dict[Callable[[], None], None] = {}
        self.restarts = RestartDetector(self._timers, ask, self._on_one)
        self.liveness = Liveness(
            self._timers,
            probe=ask,
            wanted=lambda: not self._closed and bool(self._sent or self._queued()),
            on_silence=self._on_silence,
            on_return=self._on_return,
        )
        self.readiness = ServerReadiness(
            self._timers,
            list_servers=self._list_servers,
            services_ready=self._services_ready,
            probe=ask,
            on_ready=self._on_ready,
            on_change=self._on_change,
            on_mismatch=self._on_mismatch,
            action_type=type_name,
        )
        if entities.matched is None:
            self._poll_matched()

    def close(self) -> None:
        """Tell nobody anything any more."""
        self._closed = True
        self._timers.close()
        self.restarts.close()
        self.readiness.close()

    # --- who waits for a server ------------------------------------------------------------

    def await_server(self, listener: GoalListener) -> None:
        """Tell the listener once when a server is ready, or while another type is served."""
        if self.readiness.ready:
            listener.on_server_ready()
            return
        self._awaiting[listener] = None
        self.readiness.look(lambda: bool(self._awaiting))

    def await_next_ready(self, listener: GoalListener) -> None:
        """Tell the listener again when a server is ready supersedes_earlier."""
        self._awaiting[listener] = None

    def dequeue(self, listener: GoalListener) -> None:
        """Undo `await_server` and `await_next_ready`."""
        self._awaiting.pop(listener, None)

    def add_ready_waiter(self, callback: Callable[[], None]) -> None:
        """Call `callback` whenever a server becomes ready."""
        self._ready_waiters[callback] = None

    def remove_ready_waiter(self, callback: Callable[[], None]) -> None:
        """Undo `add_ready_waiter`."""
        self._ready_waiters.pop(callback, None)

    @property
    def waiting(self) -> int:
        """How many wait for a server."""
        return len(self._awaiting) + len(self._ready_waiters)

    # --- what is seen ----------------------------------------------------------------------

    def matched(self, count: int, came: int = 0) -> None:
        """The middleware sees `count` feedback publishers now, `came` of them new."""
        self.readiness.matched(count, came)
        if count > 1 and not self._warned:
            self._warned = True
            # Their names are known a moment later.
            self._timers.call_at(self._timers.now() + _NAMING, self._warn_of_several)

    def suspect(self) -> None:
        """One of several servers does not know a goal: find out whether another is left (R1)."""
        self.restarts.begin()

    def count_answer(self, question: int) -> None:
        """A question was answered, perhaps one that `suspect` asked."""
        self.restarts.answered(question)

    @property
    def counting(self) -> bool:
        """Whether further answers to the same question matter."""
        return self.restarts.running

    def _poll_matched(self) -> None:
        """Where the middleware has no matched event: look once a second (C7.4)."""
        if self._closed:
            return
        listed = self._list_servers()
        if listed is not None and len(listed) != self.readiness.count:
            self.matched(len(listed))
        self._timers.call_at(self._timers.now() + _MATCHED_PERIOD, self._poll_matched)

    def _warn_of_several(self) -> None:
        servers = [] if self._closed else self._list_servers() or []
        if len(servers) > 1:
            log_later(
                logging.WARNING,
                "action %s has %d servers (%s): each of them runs every goal, and the first"
                " answer counts; after a restart the old one shows for up to 20 s",
                self._name,
                len(servers),
                ", ".join(server.node or "unnamed" for server in servers),
            )

    def _list_servers(self) -> list[graph.ServerInfo] | None:
        try:
            return graph.servers(self._runtime.node, self._name)
        except (RCLError, InvalidHandle):
            return None  # the context was shut down, and with it the graph (R10)

    def _services_ready(self) -> bool:
        try:
            return self._entities.services_ready()
        except (RCLError, InvalidHandle):
            return self.readiness.count > 0

    # --- who is told -----------------------------------------------------------------------

    def _on_ready(self) -> None:
        awaiting, self._awaiting = self._awaiting, {}
        for listener in awaiting:
            listener.on_server_ready()
        for callback in list(self._ready_waiters):
            callback()
        self._on_return()
        self._tell_ready()

    def _on_return(self) -> None:
        for goal in list(self._sent.values()):
            goal.listener.on_server_ready()

    def _on_mismatch(self, served: tuple[str, ...]) -> None:
        for listener in list(self._awaiting):
            listener.on_type_mismatch(served)

    def _on_silence(self, limit: float) -> None:
        for goal in list(self._sent.values()):
            goal.listener.on_server_lost(f"its server answered nothing for {limit:g} s")

    def _on_change(self, came: frozenset[bytes], gone: frozenset[bytes]) -> None:
        for goal in self._sent.values():
            self._reconsider(goal, came)
        if not gone:
            return
        reason = "its action server is gone"
        for goal in list(self._sent.values()):
            self._lose(goal, gone, reason)
        if not self.readiness.servers:
            for listener in self._queued():
                listener.on_server_lost(reason)

    def _reconsider(self, goal: SentGoal, came: frozenset[bytes]) -> None:
        """Whether a goal may be on servers that were not known when it was sent.

        A request finds a server before the server is in sight here; and it may have gone to one
        that the graph did not show yet. Where it did not, the server itself says so when asked.
        """
        unnamed = UNNAMED & goal.servers
        if unnamed or goal.sent_at > self._runtime.now() - _IN_SIGHT_WITHIN:
            goal.servers |= came
            goal.sent_to |= came
        if unnamed and not unnamed & self.readiness.servers:
            goal.servers = goal.servers - UNNAMED | self.readiness.servers
            goal.sent_to |= self.readiness.servers

    def _on_one(self) -> None:
        """Of several servers one answers, and it does not know a goal of ours."""
        nodes = {server.gid: server.node for server in self._list_servers() or ()}
        for goal in list(self._sent.values()):
            newer = {nodes.get(gid, "") for gid in self.readiness.servers - goal.servers} - {""}
            replaced = frozenset(gid for gid in goal.servers if nodes.get(gid) in newer)
            if replaced:
                goal.sent_to -= replaced
                self._lose(goal, replaced, "its server was restarted")
                if self.readiness.ready:
                    goal.listener.on_server_ready()  # the other may say that it has no such goal
        if "" in nodes.values() and self._sent and not self._closed:
            # Nodes get their names some time after their endpoints.
            self._timers.call_at(self._timers.now() + _NAMING, self.restarts.begin)

    def _lose(self, goal: SentGoal, gone: frozenset[bytes], reason: str) -> None:
        goal.servers -= gone
        if not goal.servers or not self.readiness.servers:
            goal.listener.on_server_lost(reason)

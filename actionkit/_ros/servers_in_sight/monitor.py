"""Tells goals when a server is ready, and when a server that may have them is lost.

`readiness` knows which servers are there, `restarts` whether several of them answer, `liveness`
whether any server answers. This module knows which servers may have which goal, and tells the
goals' listeners. All of it happens on the communication thread.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

from rclpy.exceptions import InvalidHandle

from actionkit._ros.answers.listener import GoalListener, Waiter
from actionkit._ros.communication.runtime import Runtime
from actionkit._ros.endpoints import graph
from actionkit._ros.endpoints.entities import Entities
from actionkit._ros.endpoints.names import ActionNames
from actionkit._ros.rclpy_private.native import RCLError
from actionkit._ros.servers_in_sight.found_by_server import FoundByServer
from actionkit._ros.servers_in_sight.liveness import Liveness
from actionkit._ros.servers_in_sight.readiness import UNNAMED, ServerReadiness
from actionkit._ros.servers_in_sight.restarts import SEEMS_RESTARTED, RestartDetector
from actionkit._threads.clock import TimerGroup
from actionkit._threads.diagnostics import log_later

_NAMING = 0.5
"""Seconds until the graph knows the node names of servers that it has just discovered."""
_MATCHED_PERIOD = 1.0
"""Seconds between two looks at the graph, as often as an idle client may look (C7.4)."""
_IN_SIGHT_WITHIN = 0.1
"""Seconds in which a new server may get requests before it is in sight here. A server needs more
time to start. So a goal that was sent before a restart was not sent to the new server."""


@dataclass(slots=True)
class _SentGoal:
    """The servers that may have one goal, by their ids. Each set contains the one before it."""

    sent_at: float
    servers: frozenset[bytes]
    """Those that have not gone out of sight since it was sent. With the last, the goal is lost."""
    sent_to: frozenset[bytes]
    """And those that have: if one is seen again, it is asked about the goal."""
    given_to: frozenset[bytes]
    """And those that seem to have been replaced by another of their name: nothing more is expected
    from them, but only when they leave the graph is it certain that they do not run the goal."""


class ServerMonitor:
    """Follows the servers of one action for the goals of one link."""

    def __init__(
        self,
        runtime: Runtime,
        entities: Entities,
        *,
        names: ActionNames,
        type_name: str,
        probe: Callable[[], int],
        listeners: Mapping[bytes, GoalListener],
        queued: Callable[[], list[Waiter]],
        on_ready: Callable[[], None],
    ) -> None:
        """Begin to look for servers.

        Args:
            probe: Sends a question that every live server answers; returns the sequence number.
            listeners: The listeners of the goals that may be on a server, by id. Only read here.
            queued: Returns the calls with goals that wait for their turn.
            on_ready: Called when goals can be sent to a server that has come.
        """
        self._runtime = runtime
        self._timers = TimerGroup(runtime, runtime.cancel_timer)
        self._entities = entities
        self._names = names
        self._listeners = listeners
        self._queued = queued
        self._tell_ready = on_ready
        self._closed = False
        self._warned = False
        self._goals: dict[bytes, _SentGoal] = {}
        self._awaiting: dict[Waiter, None] = {}
        self._ready_waiters: dict[Callable[[], None], None] = {}
        self._none_gone_until = 0.0  # before that time, no server counts as gone
        self._doubted: frozenset[bytes] = frozenset()  # those out of sight until then
        self.restarts = RestartDetector(self._timers, probe, self._on_one_answers)
        self.liveness = Liveness(
            self._timers,
            probe=probe,
            wanted=lambda: not self._closed and bool(self._goals or self._queued()),
            on_silence=self._on_silence,
            on_return=self.tell_sent_goals,
        )
        self.readiness = ServerReadiness(
            self._timers,
            list_publishers=self._list_publishers,
            services_ready=self._services_ready,
            other_versions=self._other_versions,
            probe=probe,
            on_ready=self._on_ready,
            on_change=self._on_change,
            on_mismatch=self._on_mismatch,
            on_complete=lambda: self._found_by_server.watch(),  # noqa: PLW0108  it is made below
            action_type=type_name,
        )
        self._found_by_server = FoundByServer(runtime, entities, self.readiness.known)
        if entities.matched is None:
            self._poll_matched()

    def close(self) -> None:
        """Cancel all timers and tell nobody anything any more."""
        self._closed = True
        self._timers.close()
        self.readiness.close()
        self._found_by_server.stop()

    # --- waiting for a server --------------------------------------------------------------

    def await_server(self, waiter: Waiter) -> None:
        """Tell the waiter once when a server is ready, or has another type."""
        if self.readiness.ready:
            waiter.on_server_ready()
        else:
            self.await_next_ready(waiter)

    def await_next_ready(self, waiter: Waiter) -> None:
        """Tell the waiter when a server becomes ready the next time."""
        self._awaiting[waiter] = None
        self._look()

    def _look(self) -> None:
        self.readiness.look(lambda: bool(self._awaiting or self._ready_waiters))

    def stop_waiting(self, waiter: Waiter) -> None:
        """Undo `await_server` and `await_next_ready`."""
        self._awaiting.pop(waiter, None)

    def add_ready_waiter(self, callback: Callable[[], None]) -> None:
        """Call `callback` whenever a server becomes ready."""
        self._ready_waiters[callback] = None
        self._look()

    def remove_ready_waiter(self, callback: Callable[[], None]) -> None:
        """Undo `add_ready_waiter`."""
        self._ready_waiters.pop(callback, None)

    @property
    def waiting(self) -> int:
        """How many listeners and callbacks wait for a server."""
        return len(self._awaiting) + len(self._ready_waiters)

    # --- which server may have which goal --------------------------------------------------

    def goal_sent(self, key: bytes) -> int:
        """Record that a goal was sent now; return how many servers may have it."""
        servers = self.readiness.servers
        self._goals[key] = _SentGoal(self._runtime.now(), servers, servers, servers)
        return len(servers)

    def forget(self, key: bytes) -> None:
        """Forget a sent goal."""
        del self._goals[key]

    def sees_server_of(self, key: bytes) -> bool:
        """Whether a server in sight may have got the goal."""
        goal = self._goals.get(key)
        return goal is not None and bool(goal.sent_to & self.readiness.servers)

    def seems_replaced(self, key: bytes) -> bool:
        """Whether each server in sight that may have the goal only seems to have been replaced."""
        goal, servers = self._goals.get(key), self.readiness.servers
        return goal is not None and bool(goal.given_to & servers) and not goal.sent_to & servers

    def may_be_elsewhere(self, key: bytes) -> bool:
        """Whether another server may have the goal if one says that it does not know it."""
        return self.sees_server_of(key) and self.readiness.count > 1

    # --- after this process itself stood still ---------------------------------------------

    def stood_still(self, until: float) -> None:
        """Until that time, count no server as gone; then count those out of sight as gone."""
        self.liveness.start_over()
        self._none_gone_until = until
        self._timers.call_at(until, self._end_doubt)

    def leave(self) -> None:
        """Handle that the node is replaced: the new one will discover the servers again."""
        self._doubted |= self.readiness.servers
        self.readiness.leave()
        self._found_by_server.stop()

    def _end_doubt(self) -> None:
        if self._closed or self._timers.now() < self._none_gone_until:
            return
        gone, self._doubted = self._doubted - self.readiness.servers, frozenset()
        if gone:
            self._tell_who_has_them()
            self._lose_all(gone)

    # --- what is seen ----------------------------------------------------------------------

    def _poll_matched(self) -> None:
        """Look at the graph once a second, if the middleware has no matched event."""
        listed = self._list_publishers()
        if listed is not None and len(listed) != self.readiness.publishers:
            self.readiness.matched(len(listed))
        self._timers.call_at(self._timers.now() + _MATCHED_PERIOD, self._poll_matched)

    def _warn_of_several(self) -> None:
        servers = self._list_servers()
        if len(servers) > 1 and not self._warned:
            self._warned = True
            names = ", ".join(server.node for server in servers)
            one_process = len({server.participant for server in servers}) == 1
            log_later(
                logging.WARNING,
                "action %s has %d servers%s: each of them runs every goal, and the first"
                " answer counts; %s",
                self._names.action,
                len(servers),
                f" ({names})" if all(server.node for server in servers) else "",
                "they are in one process: start it again, and if it has two again, change it"
                if one_process
                else "after a restart the old one shows for up to 20 s",
            )

    def _list_servers(self) -> list[graph.Endpoint]:
        return [end for end in self._list_publishers() or () if end.serves]

    def _list_publishers(self) -> list[graph.Endpoint] | None:
        try:
            listed = graph.publishers(self._runtime.node, self._names)
            # Not while a server is matched: to its goals, it would seem to go and to come again.
            if self.readiness.count == 0 and any(end.best_effort and end.serves for end in listed):
                self._entities.receive_best_effort()
        except (RCLError, InvalidHandle):
            return None  # the context was shut down, and with it the graph (R10)
        return listed

    def _services_ready(self) -> bool:
        try:
            return self._entities.services_ready()
        except (RCLError, InvalidHandle):
            return self.readiness.count > 0

    def _other_versions(self) -> tuple[str, ...]:
        try:
            node = self._runtime.node
            seen = graph.versions(node, self._names, of_client=node.get_name())
            return tuple(str(each) for each in seen if each.differ)
        except (RCLError, InvalidHandle):
            return ()

    # --- listeners -------------------------------------------------------------------------

    def _sent_goals(self) -> Iterator[tuple[GoalListener, _SentGoal]]:
        """Yield each sent goal with its listener, except those forgotten in the meantime."""
        for key, goal in list(self._goals.items()):
            if (listener := self._listeners.get(key)) is not None:
                yield listener, goal

    def _on_ready(self) -> None:
        self._found_by_server.stop()
        awaiting, self._awaiting = self._awaiting, {}
        for waiter in awaiting:
            waiter.on_server_ready()
        for callback in list(self._ready_waiters):
            callback()
        self.tell_sent_goals()
        self._tell_ready()

    def tell_sent_goals(self) -> None:
        """Tell the goals that may be on a server that one is ready.

        Other servers know nothing about goals that were lost with their own server.
        """
        for listener, goal in self._sent_goals():
            if goal.servers or goal.given_to & self.readiness.servers:
                listener.on_server_ready()

    def _on_mismatch(self, served: tuple[str, ...]) -> None:
        for waiter in list(self._awaiting):
            waiter.on_type_mismatch(served)

    def _on_silence(self, limit: float) -> None:
        for listener, _ in self._sent_goals():
            listener.on_server_lost(f"its server answered nothing for {limit:g} s")

    def _on_change(self, came: frozenset[bytes], gone: frozenset[bytes]) -> None:
        for goal in self._goals.values():
            self._reconsider(goal, came)
        self._doubted -= came
        doubtful = self._timers.now() < self._none_gone_until
        if doubtful:
            self._doubted |= gone
        self._tell_who_has_them()
        if gone and not doubtful:
            self._lose_all(gone)
        if len(self.readiness.servers) > 1 and not self._warned:
            # Their names are known a moment later.
            self._timers.call_at(self._timers.now() + _NAMING, self._warn_of_several)

    def _tell_who_has_them(self) -> None:
        """Tell the goals how many servers may have them, and how many of these have left."""
        servers = self.readiness.servers
        present = servers | self._doubted | (UNNAMED if servers else frozenset())
        for listener, goal in self._sent_goals():
            # A server that went before it had a name is not in the set any more.
            given_to = max(1, len(goal.given_to))
            listener.on_servers_changed(given_to, given_to - len(goal.given_to & present))

    def _lose_all(self, gone: frozenset[bytes]) -> None:
        reason = "its action server is gone"
        for listener, goal in self._sent_goals():
            self._lose(listener, goal, gone, reason)
            if not goal.servers and self.readiness.ready:
                # A goal that another client has sent may be on a server that came later.
                listener.on_server_ready()
        if not self.readiness.servers:
            for waiter in [*self._queued(), *self._awaiting]:
                waiter.on_server_lost(reason)
            self._found_by_server.stop()
            self._look()  # for listeners that waited for an answer

    def _reconsider(self, goal: _SentGoal, came: frozenset[bytes]) -> None:
        """Add servers that may have a goal although they were not known when it was sent.

        A request may reach a server before that server is in sight here or in the graph. If the
        server does not have the goal, it says so when it is asked. A goal that was lost with all
        servers cannot be on a server that comes later.
        """
        if not goal.servers:
            return
        unnamed = UNNAMED & goal.servers
        if unnamed or goal.sent_at > self._runtime.now() - _IN_SIGHT_WITHIN:
            goal.servers |= came
            goal.sent_to |= came
            goal.given_to |= came
        if unnamed and not unnamed & self.readiness.servers:
            goal.servers = goal.servers - UNNAMED | self.readiness.servers
            goal.sent_to |= self.readiness.servers
            goal.given_to = goal.given_to - UNNAMED | self.readiness.servers

    def _on_one_answers(self) -> None:
        """Find the goals of a server that was replaced: only one of several servers answers."""
        nodes = {server.gid: server.node for server in self._list_servers() or ()}
        for listener, goal in self._sent_goals():
            newer = {nodes.get(gid, "") for gid in self.readiness.servers - goal.servers} - {""}
            replaced = frozenset(gid for gid in goal.servers if nodes.get(gid) in newer)
            if replaced:
                goal.sent_to -= replaced
                self._lose(listener, goal, replaced, SEEMS_RESTARTED)
                if self.readiness.ready:
                    listener.on_server_ready()  # the new one can say whether it knows the goal
        if "" in nodes.values() and self._goals:
            # Nodes get their names some time after their endpoints.
            self._timers.call_at(self._timers.now() + _NAMING, self.restarts.start)

    def _lose(
        self, listener: GoalListener, goal: _SentGoal, gone: frozenset[bytes], reason: str
    ) -> None:
        goal.servers -= gone
        if not goal.servers or not self.readiness.servers:
            listener.on_server_lost(reason)

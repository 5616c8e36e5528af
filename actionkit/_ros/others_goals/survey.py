"""Finds the nodes that serve and use actions in the ROS graph, with a new node."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

from typing_extensions import Self

from actionkit._ros.communication import runtimes
from actionkit._ros.communication.own_node import resolve_without_node
from actionkit._ros.endpoints import graph
from actionkit._ros.endpoints.entities import Entities
from actionkit._ros.endpoints.names import ActionNames, check_name

_STEP = 0.05
"""Seconds between two looks at the graph; each takes about a millisecond."""
_QUIET = 0.4
"""Seconds without anything new, after which the graph counts as complete."""
_LEAST = 3.0
"""Seconds to look at least. On a busy machine, a third of the processes are seen only after 1 to
3 s, also by rclpy: the first messages of Fast DDS may get lost, and it repeats them after 3 s."""
_MOST = 7.0
"""Seconds to look at most, enough for a second repetition by Fast DDS."""
_JOIN = 5.0
"""Seconds for the communication thread to end; it takes some ten milliseconds."""


@dataclass(frozen=True)
class ActionSeen:
    """One action name, and the nodes on it."""

    name: str
    servers: tuple[graph.Endpoint, ...]
    clients: tuple[graph.Endpoint, ...]
    only_publishing: tuple[graph.Endpoint, ...] = ()
    """Who publishes feedback, and does not serve: a bag player, a relay, a bridge."""

    @property
    def types(self) -> tuple[str, ...]:
        """The types of its servers or, without a server, of its clients."""
        return tuple(sorted({end.action_type for end in self.servers or self.clients}))


class Survey:
    """Looks at the graph. A context manager."""

    def __init__(
        self, place: runtimes.Place | None = None, only: ActionNames | None = None
    ) -> None:
        """Take the node of a place, or make one, which begins to discover others.

        `place` is that of `runtimes.acquire`. `only` are the names of one action: no other one is
        looked at. Any error of rclpy goes to the caller.
        """
        began = time.monotonic()
        self.place = place
        self._only = only
        self.runtime = runtimes.acquire(place, self)
        self.opened = time.monotonic()
        self.seconds_to_open = self.opened - began
        """Seconds that making the context and the node took."""
        self.first_seen: dict[str, float] = {}
        """For each action, the seconds from `opened` until a server of it was seen."""
        self.on_look: list[Callable[[dict[str, ActionSeen]], object]] = []
        """Called with the actions in sight at each look."""

    @property
    def domain_id(self) -> int:
        """The ROS domain."""
        return int(self.runtime.context.get_domain_id())

    @property
    def middleware(self) -> str:
        """The name of the middleware in use, such as `rmw_fastrtps_cpp`."""
        return graph.middleware()

    def resolve(self, name: str) -> str:
        """Return the full name of an action.

        Raises:
            ValueError: It is not a valid name.
        """
        check_name(name, has_node=False)
        node = self.runtime.node
        return self.runtime.run(lambda: resolve_without_node(node.context, node, name)).action

    def names(self, name: str) -> ActionNames:
        """Return the names of an action's services and topics, remapped as those given."""
        return ActionNames.of(name) if self._only is None else self._only

    def actions(self) -> dict[str, ActionSeen]:
        """Return the actions that are in sight now, sorted by name."""
        node = self.runtime.node
        seen = {}
        found = graph.action_names(node) if self._only is None else [self._only.action]
        for name in sorted(found):
            names = self.names(name)
            publishers = graph.publishers(node, names)
            clients = node.get_subscriptions_info_by_topic(names.feedback)
            action = ActionSeen(
                name,
                servers=_endpoints(end for end in publishers if end.serves),
                clients=_endpoints(map(graph.endpoint_of, clients)),
                only_publishing=_endpoints(end for end in publishers if not end.serves),
            )
            seen[name] = action
            if action.servers:
                self.first_seen.setdefault(name, time.monotonic() - self.opened)
        for call in self.on_look:
            call(seen)
        return seen

    def may_hide_goals(self, name: str) -> bool:
        """Whether an action without a server in sight may have goals.

        A process that stands still is out of sight for one that comes later; its clients are not.
        They read the status; a client of ours that merely waits for a server does not.
        """
        topic = self.names(name).status
        seen = self.actions().get(name)
        if seen is None or seen.servers or not seen.clients:
            return False
        return bool(self.runtime.node.get_subscriptions_info_by_topic(topic))

    def versions(self, name: str) -> list[graph.Versions]:
        """Return the type hashes of an action's servers and clients."""
        return graph.versions(self.runtime.node, ActionNames.of(name))

    def versions_here(self, name: str, action_type: Any) -> list[graph.Versions]:
        """Return the type hashes of an action's servers, and of this class of the action's type.

        For that it makes the entities of a client for a moment. Any error of rclpy goes to the
        caller, above all where the library of the type cannot be loaded.
        """
        node, names = self.runtime.node, ActionNames.of(name)

        def look() -> list[graph.Versions]:
            nothing = {f"on_{what}": lambda *_: None for what in ("goal", "result", "cancel")}
            more = {f"on_{what}": lambda *_: None for what in ("feedback", "matched")}
            entities = Entities(node, action_type.Impl, names, **nothing, **more)
            try:
                return graph.versions(node, names, of_client=node.get_name())
            finally:
                entities.destroy()

        return self.runtime.run(look)

    def settled(
        self,
        least: float = _LEAST,
        most: float = _MOST,
        enough: Callable[[dict[str, ActionSeen]], bool] = bool,
    ) -> dict[str, ActionSeen]:
        """Look until nothing new has been discovered for a while: discovery has no defined end.

        Look for at least `least` and at most `most` seconds (or `least`, if that is more). `enough`
        says whether the actions in sight are enough to stop early; by default, any action is.
        """
        since = time.monotonic()
        last = self.actions()
        while True:
            now = time.monotonic()
            known = all(e.node for a in last.values() for e in (*a.servers, *a.clients))
            quiet = now - since >= _QUIET and known and enough(last)
            if now - self.opened >= (least if quiet else max(least, most)):
                return last
            time.sleep(_STEP)
            seen = self.actions()
            if seen != last:
                last, since = seen, time.monotonic()

    def close(self) -> None:
        """Release the node."""
        runtimes.release(self.runtime, self)
        self.runtime.join_if_stopping(_JOIN)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _endpoints(ends: Iterable[graph.Endpoint]) -> tuple[graph.Endpoint, ...]:
    return tuple(sorted(ends, key=lambda end: (end.node, end.action_type, end.gid)))

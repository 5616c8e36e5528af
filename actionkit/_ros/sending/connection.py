"""The rest of the library's access to rclpy: a link, and the thread that works on it.

A connection outlives its client as long as a goal may still have to be cancelled.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from rclpy.context import Context
from rclpy.exceptions import InvalidHandle
from rclpy.node import Node
from rclpy.serialization import deserialize_message, serialize_message
from typing_extensions import Self

from actionkit._model.action_type import type_name_of
from actionkit._model.environment.domain import Domain
from actionkit._model.errors import ActionTypeMismatchError
from actionkit._ros.answers.wire import feedback_alone
from actionkit._ros.communication import runtimes
from actionkit._ros.communication.own_node import resolve_without_node
from actionkit._ros.communication.secured import explained
from actionkit._ros.endpoints import graph
from actionkit._ros.endpoints.names import ActionNames, Identity, check_name, resolve
from actionkit._ros.rclpy_private import executors, native
from actionkit._ros.rclpy_private.native import RCLError, domain_of, is_up
from actionkit._ros.sending.link import Link
from actionkit._threads.clock import TimerHandle
from actionkit._threads.waiting import Flag

_UNDONE_WITHIN = 5.0
"""Seconds that freeing the parts of a failed constructor may take; it takes milliseconds."""
_OF_A_NODE = (
    *("context", "handle", "get_fully_qualified_name"),
    *("resolve_service_name", "resolve_topic_name"),
)
DIED = "the communication thread of ActionKit died"


class Connection:
    """One client's link and the communication thread that works on it."""

    def __init__(self, action_type: Any, action_name: object, node: Any = None) -> None:
        """Make a link on the communication thread of the node's context.

        Without a node, the context is rclpy's default one if it is up, otherwise our own. `node`
        and its namespace and remappings also resolve `action_name`; without a node, ActionKit's own
        node does that. If this fails, nothing that it made remains.

        Raises:
            TypeError: A wrong type of argument.
            ValueError: A bad name, arguments of the process that ROS refuses, or a node or context
                that cannot be used any more.
            ActionTypeMismatchError: The process already uses the name with another type.
            SecurityError: ROS security keeps the process, or the action, out.
        """
        type_name = type_name_of(action_type)
        domain, node = (node, None) if isinstance(node, Domain) else (None, node)
        if node is not None and not _is_node(node):
            raise TypeError(f"node={node!r} must be an rclpy node")
        name = check_name(action_name, has_node=node is not None)
        context = _users_context(node) if domain is None else None
        names = None if node is None else resolve(node, name)
        self.freed = Flag()
        """Set when the entities are destroyed and the runtime is released."""
        self._node: Node | None = node
        self.server_waits: set[Flag] = set()
        """Flags that are set when this is freed. On the communication thread, like the next."""
        self.waits_ended = False
        with _told_if_down(context):
            self.runtime = runtimes.acquire(domain.id if domain else context, self)
            try:
                self.names = names or self._resolve(name)
                self.identity = Identity(
                    action_name=self.names.action,
                    type_name=type_name,
                    domain_id=domain_of(self.runtime.context),
                    label="" if node is None else node.get_fully_qualified_name(),
                )
                own = self.runtime.own_context is not None
                with explained(self.runtime.context, own=own):
                    self.runtime.run(lambda: self._open(action_type))
            except BaseException:  # also after Ctrl-C: nothing remains
                self.runtime.call_soon(self._undo)
                # The middleware's exit handlers crash if a thread still uses it.
                self.freed.wait(_UNDONE_WITHIN)
                self.runtime.join_if_stopping(_UNDONE_WITHIN)
                raise
        self.action_type = action_type
        self._feedback_type: Any = action_type.Feedback

    # --- from any thread -------------------------------------------------------------------

    @property
    def has_node(self) -> bool:
        """Whether the client was made with `node=`."""
        return self._node is not None

    def why_unusable(self) -> str:
        """Return what calls need that has ended, or `""`: our thread, or the user's ROS.

        The user's ROS is the context of the client's node. Without a node, it is rclpy's default
        context, or our own one. Only rclpy's signal handler shuts down our own context: it shuts
        down every context of the process (R10).
        """
        if self.runtime.failure is not None:
            return DIED
        if self._node is not None:
            if not is_up(self._node.context):
                return "the ROS context of its client's node was shut down"
            if native.node_is_destroyed(self._node):
                return "its client's node was destroyed"
        if not is_up(self.runtime.context):
            return "rclpy.shutdown() or its signal handler shut down ROS in this process"
        return ""

    def end_spinning(self) -> None:
        """If the user's context was shut down, let the executors there notice that."""
        context = native.default_context() if self._node is None else self._node.context
        if context is not None and not is_up(context):
            executors.wake_executors(context)

    def decode_feedback(self, message: bytes) -> Any:
        """Return the feedback in a serialised feedback message.

        Raises:
            ValueError: The bytes are not a feedback message of the action's type.
        """
        try:
            return deserialize_message(feedback_alone(message), self._feedback_type)
        except RuntimeError as error:  # rclpy raises it for errors of the middleware
            raise ValueError(
                f"a feedback message of action {self.identity.action_name!r}, {len(message)} bytes,"
                f" is no {self.identity.type_name} feedback ({error}): does its server use another"
                " version of that type?"
            ) from error

    def pack(self, message: Any) -> bytes:
        """Return a message, serialised."""
        return bytes(serialize_message(message))

    def unpack(self, message: bytes, cls: Any) -> Any:
        """Return a message of a class that was serialised."""
        return deserialize_message(message, cls)

    def table_sizes(self) -> dict[str, int]:
        """Return how many entries each table of the link has, and how many timers there are."""
        return self.runtime.run(
            lambda: {**self.link.table_sizes(), "timers": len(self.runtime.timers)}
        )

    # --- on the communication thread -------------------------------------------------------

    def end_waits(self) -> None:
        """End all waits for a server, even those that begin later."""
        self.waits_ended = True
        for over in self.server_waits:
            over.set()

    def _open(self, action_type: Any) -> None:
        name, type_name = self.identity.action_name, self.identity.type_name
        used = dict(self.runtime.names_in_use).get(name)
        if used not in (None, type_name):
            # The middleware refuses it, too, but does not say why (R21).
            error = ActionTypeMismatchError(
                f"action {name!r} is used as {used} by another client of this process, and"
                f" cannot be used as {type_name} here: one of the two has the wrong type",
                action_name=name,
            )
            error.expected, error.served = type_name, (str(used),)
            raise error
        self.runtime.expect_more()
        self.link = Link(self.runtime, action_type, type_name, self.names)
        self.runtime.names_in_use.append((name, type_name))

    def _resolve(self, action_name: str) -> ActionNames:
        runtime = self.runtime
        return runtime.run(lambda: resolve_without_node(runtime.context, runtime.node, action_name))

    def _undo(self) -> None:
        """Free what a failed constructor has made."""
        if hasattr(self, "link"):
            self.free()
        else:
            runtimes.release(self.runtime, self)
            self.freed.set()

    def actions(self) -> dict[str, tuple[str, ...]] | None:
        """Return every served action with its types; `None` after the context's shutdown (R10)."""
        try:
            return graph.all_actions(self.runtime.node)
        except (RCLError, InvalidHandle):
            return None

    def only_publishing(self) -> tuple[str, ...]:
        """Return the nodes that publish the action's feedback, and do not serve it."""
        try:
            found = graph.publishers(self.runtime.node, self.names)
        except (RCLError, InvalidHandle):
            return ()
        return tuple(sorted({end.node for end in found if end.node and not end.serves}))

    def best_effort(self) -> tuple[str, ...]:
        """Return which of the action's services are offered best-effort."""
        try:
            return graph.best_effort_services(self.runtime.node, self.names)
        except (RCLError, InvalidHandle):
            return ()

    def sends_no_data(self) -> bool:
        """Return whether the action's servers are in sight, but nothing of them arrives."""
        if self.link.liveness.has_heard:
            return False  # a bridge to ROS may have no name for its node
        try:
            return graph.no_data_from(graph.servers(self.runtime.node, self.names))
        except (RCLError, InvalidHandle):
            return False

    def free(self) -> None:
        """Destroy the entities and release the runtime."""
        self.end_waits()
        self.link.close()
        self.runtime.names_in_use.remove((self.identity.action_name, self.identity.type_name))
        runtimes.release(self.runtime, self)
        self.freed.set()
        self.end_spinning()  # a client that is closed at once may have missed the shutdown


def _is_node(node: object) -> bool:
    """Whether it offers what we need of a node; rclpy may have other kinds than `Node`."""
    return not isinstance(node, type) and all(hasattr(node, name) for name in _OF_A_NODE)


def _users_context(node: Node | None) -> Context | None:
    """Return the user's context for a client; `None` if the user has none that is up.

    Raises:
        ValueError: The node's context was shut down.
    """
    if node is None:
        return native.default_context() if native.default_context_is_up() else None
    if not is_up(node.context):
        raise ValueError(f"the ROS context of node={node!r} was shut down: give one that is in use")
    return node.context


@contextmanager
def _told_if_down(context: Context | None) -> Iterator[None]:
    """Raise a clearer error if the shutdown of a user's context just now was the reason."""
    try:
        yield
    except (RCLError, InvalidHandle) as error:
        if context is None or is_up(context):
            raise
        raise ValueError(
            "the ROS context was shut down while the client was made: make it before that"
        ) from error


class ServerWait:
    """One wait until goals can be sent. It lasts while this is entered as a context manager."""

    def __init__(self, connection: Connection, seconds: float | None) -> None:
        """Plan a wait of `seconds` (`None` means no limit); `end_waits` may end it earlier."""
        self.seconds = seconds
        self.ready = False
        """Whether goals can be sent."""
        self.over = Flag()
        """Set when goals can be sent, when the time is over, or when the connection is freed."""
        self._connection = connection
        self._timer: TimerHandle | None = None

    def __enter__(self) -> Self:
        self._connection.runtime.call_soon(self._begin)
        return self

    def __exit__(self, *exc: object) -> None:
        self._connection.runtime.call_soon(self._end)

    def _begin(self) -> None:
        if self._connection.waits_ended:
            self.over.set()
            return
        self._connection.server_waits.add(self.over)
        self._connection.link.monitor.add_ready_waiter(self._tell)
        if self._connection.link.server_is_ready():
            self._tell()
        elif self.seconds is not None:
            until = time.monotonic() + self.seconds
            self._timer = self._connection.runtime.call_at(until, self.over.set)

    def _tell(self) -> None:
        self.ready = True
        self.over.set()

    def _end(self) -> None:
        self._connection.server_waits.discard(self.over)
        self._connection.link.monitor.remove_ready_waiter(self._tell)
        if self._timer is not None:
            self._connection.runtime.cancel_timer(self._timer)

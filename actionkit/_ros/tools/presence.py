"""Keeps this process in the ROS graph, so that its clients find a server at once.

A client in a process without others has to enter the graph, and there to discover the servers one
by one: 0.1 to 0.3 s, on a busy machine seconds. All clients of a context share one node, so who
made that node before, and saw the server from it, has spared them that.
"""

from __future__ import annotations

from functools import partial
from typing import Any

from rclpy.exceptions import InvalidHandle

from actionkit._model.domain import environment_domain
from actionkit._model.errors import ActionTypeMismatchError
from actionkit._ros import native, runtimes
from actionkit._ros.port import Port
from actionkit._ros.runtime import Runtime

_LEFT_WITHIN = 5.0
"""Seconds for the node to leave the graph; it takes milliseconds on an idle machine."""


class Presence:
    """The node that clients of this process will use, kept from `see` until `leave`."""

    def __init__(self) -> None:
        self._runtime: Runtime | None = None

    def see(self, action_type: Any, action_name: str, domain_id: int, timeout: float) -> bool:
        """Wait until a server is ready for clients of this process that are made without `node=`.

        Nothing is done where they would not find it: they are in another ROS domain, resolve its
        name to another one, or use that with another type.

        Args:
            action_type: The action's class.
            action_name: The full name of the action.
            domain_id: The server's ROS domain.
            timeout: Seconds to wait.

        Returns:
            Whether it did not take longer than that.
        """
        if _domain_of_clients() != domain_id:
            return True
        try:
            port = Port(action_type, action_name)
        except (ValueError, ActionTypeMismatchError):
            return True
        try:
            if port.identity.action_name != action_name:
                return True
            with port.server_wait(timeout) as wait:
                wait.over.wait(timeout)
            # Not before: a node that somebody needs is not replaced if it has missed the server.
            if port.runtime.run(partial(port.runtime.add_user, self)):
                self._runtime = port.runtime
            return wait.ready
        finally:
            # The name is free again for a client of another type.
            port.runtime.run(port.free)
            port.runtime.join_if_stopping(_LEFT_WITHIN)

    def leave(self, *, at_exit: bool = False) -> None:
        """Leave the graph, unless a client is there.

        Args:
            at_exit: Whether the interpreter ends: the middleware's own exit handlers crash under a
                thread that still uses it.
        """
        runtime, self._runtime = self._runtime, None
        if runtime is None:
            return
        runtimes.release(runtime, self)
        runtime.join_if_stopping(_LEFT_WITHIN)
        if at_exit:
            runtimes.join_ending(_LEFT_WITHIN)


def _domain_of_clients() -> int | None:
    context = native.default_context() if native.default_context_is_up() else None
    try:
        return environment_domain() if context is None else native.domain_of(context)
    except (ValueError, InvalidHandle):  # there is none, or its context was shut down just now
        return None

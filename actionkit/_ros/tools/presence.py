"""Keeps this process in the ROS graph, so that its clients find a server at once.

The first client of a process has to enter the graph and discover the servers one by one. This takes
0.1 to 0.3 s, on a busy machine seconds. All clients of a context share one node. So this module
makes that node earlier, and waits until the server is seen from it.
"""

from __future__ import annotations

from functools import partial
from typing import Any

from actionkit._model.environment.domain import environment_domain
from actionkit._model.errors import ActionTypeMismatchError
from actionkit._ros.communication import runtimes
from actionkit._ros.communication.runtime import Runtime
from actionkit._ros.sending.connection import Connection, ServerWait
from actionkit._ros.tools.contexts import default_domain

_LEFT_WITHIN = 5.0
"""Seconds for the node to leave the graph; it takes milliseconds on an idle machine."""


class Presence:
    """The node that clients of this process will use, kept from `see` until `leave`."""

    def __init__(self) -> None:
        self._runtime: Runtime | None = None

    def see(self, action_type: Any, action_name: str, domain_id: int, timeout: float) -> bool:
        """Wait until clients of this process that are made without `node=` see the server.

        Do nothing if these clients would not find it: they are in another ROS domain, resolve its
        name to another one, or use the name with another type. Return whether the wait took less
        than `timeout`.
        """
        if _domain_of_clients() != domain_id:
            return True
        try:
            connection = Connection(action_type, action_name)
        except (ValueError, ActionTypeMismatchError):
            return True
        try:
            if connection.identity.action_name != action_name:
                return True
            with ServerWait(connection, timeout) as wait:
                wait.over.wait(timeout)
            # Not before: a node in use is not replaced, even if it has missed the server.
            if connection.runtime.run(partial(connection.runtime.add_user, self)):
                self._runtime = connection.runtime
            return wait.ready
        finally:
            # So that a client of another type can use the name.
            connection.runtime.run(connection.free)
            connection.runtime.join_if_stopping(_LEFT_WITHIN)

    def leave(self, *, at_exit: bool = False) -> None:
        """Leave the graph, unless a client is there.

        `at_exit` means that the interpreter ends: then wait for the thread, because the
        middleware's own exit handlers crash if a thread still uses the middleware.
        """
        runtime, self._runtime = self._runtime, None
        if runtime is None:
            return
        runtimes.release(runtime, self)
        runtime.join_if_stopping(_LEFT_WITHIN)
        if at_exit:
            runtimes.join_ending(_LEFT_WITHIN)


def _domain_of_clients() -> int | None:
    try:
        domain = default_domain()
        return environment_domain() if domain is None else domain
    except ValueError:  # not a domain
        return None

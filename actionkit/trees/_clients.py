"""Keeps the clients of leaves: given clients, and clients that leaves for one action share."""

from __future__ import annotations

import os
import threading
import weakref
from typing import Any

from actionkit import Client
from actionkit._internal_api import type_of
from actionkit._model.action_type import type_name_of
from actionkit._model.errors import ServerUnavailableError

_lock = threading.RLock()
"""Held while a client is made or released; ticks never do that. Re-entrant for signal handlers."""


class ClientHold:
    """One leaf's share of a client."""

    def __init__(self, client: object) -> None:
        """Keep a `Client`, or the action's type and name to make it from. Makes no client yet.

        Raises:
            TypeError: It is neither.
        """
        self._shared: _Shared | None = None
        self.client: Client[Any] | None = None
        self._made_from: tuple[type, str] | None = None
        if isinstance(client, Client):
            self.client = client
            self.action_type: Any = type_of(client)
            self.action_name = client.action_name
            return
        pair = client if isinstance(client, tuple) else ()
        if len(pair) != 2 or not isinstance(pair[0], type) or not isinstance(pair[1], str):
            raise TypeError(
                f"client={client!r} must be a Client, or the action's type and name, such as"
                ' (Fibonacci, "fibonacci")'
            )
        type_name_of(pair[0])  # raises if it is not an action
        self._made_from = pair
        self.action_type, self.action_name = pair

    def make(self, node: Any) -> None:
        """Make the client, or share that of another leaf. A given client is not changed.

        `node` is a node of the user, or `None`.
        """
        if self._made_from is not None and (self.client is None or self.client.closed):
            self._shared = _share(*self._made_from, node, self)
            self.client = self._shared.client
            self.action_name = self.client.action_name

    def await_server(self, server_timeout: float | None, behaviour: str) -> None:
        """Wait for a server, if the client was made here.

        A timeout of `None` means no limit; `behaviour` is the leaf's name, for the error.

        Raises:
            ServerUnavailableError: No server came in time.
        """
        if self._made_from is None or self.client is None:
            return
        if not self.client.wait_for_server(server_timeout):
            raise ServerUnavailableError(
                f"no server of the action {self.action_name!r} was ready within"
                f" {server_timeout:g} s of the setup of the behaviour {behaviour!r}: start the"
                f" server, or give the behaviour a longer server_timeout="
                f" (`actionkit doctor {self.action_name}` tells what is wrong)",
                action_name=self.action_name,
            )

    def let_go(self) -> Client[Any] | None:
        """Release the client; return it if it must be closed now."""
        shared, self._shared = self._shared, None
        if shared is None:
            return None
        self.client = None
        with _lock:
            shared.users.discard(self)
            if shared.users:
                return None
            if _open.get(shared.key) is shared:
                del _open[shared.key]
        return shared.client


class _Shared:
    """A client that leaves share. Only they keep it alive: if all are dropped, it is, too."""

    def __init__(self, key: tuple[Any, ...], client: Client[Any], node: Any) -> None:
        self.key = key
        self.client = client
        self.node = node
        self.users: weakref.WeakSet[ClientHold] = weakref.WeakSet()


_open: weakref.WeakValueDictionary[tuple[Any, ...], _Shared] = weakref.WeakValueDictionary()


def _share(action_type: Any, action_name: str, node: Any, user: ClientHold) -> _Shared:
    # A client stays in the domain in which it was made.
    domain = os.environ.get("ROS_DOMAIN_ID", "") if node is None else ""
    key = (action_type, action_name, id(node), domain)
    with _lock:
        shared = _open.get(key)
        if shared is None or shared.client.closed:
            shared = _open[key] = _Shared(key, Client(action_type, action_name, node=node), node)
        shared.users.add(user)
        return shared

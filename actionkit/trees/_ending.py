"""The end of a tree: all goals are cancelled first, then waited for together."""

from __future__ import annotations

from collections.abc import Iterable

from actionkit.trees._clients import ClientHold
from actionkit.trees._runs import AnyClient, AnyFuture, Runs


def end_together(leaves: Iterable[tuple[Runs, ClientHold]]) -> None:
    """End what leaves have: cancel, wait within one bound for all, close clients nobody needs.

    A second time there is nothing left to wait for.

    Args:
        leaves: The runs and the client of each.
    """
    waited_for: list[AnyFuture] = []
    closing: list[AnyClient] = []
    grace = 0.0
    for runs, hold in leaves:
        if runs.closed:
            continue
        runs.close()
        if hold.client is not None:
            grace = max(grace, hold.client.timeouts.cancel)
        waited_for += runs.in_flight()
        if (client := hold.let_go()) is not None:
            closing.append(client)
    for client in closing:
        client._session.close_calls()  # so that no client waits for another one's end
    if waited_for:
        from actionkit._calls.session import MARGIN, await_ends  # rclpy is there, as clients are

        await_ends(waited_for, grace + MARGIN)
    for client in closing:
        client.close()

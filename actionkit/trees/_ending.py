"""Ends a tree: first cancels all goals, then waits for all together."""

from __future__ import annotations

from collections.abc import Iterable

from actionkit._calls.closing import MARGIN, await_ends
from actionkit.trees._clients import ClientHold
from actionkit.trees._runs import AnyClient, AnyFuture, Runs


def end_together(leaves: Iterable[tuple[Runs, ClientHold]]) -> None:
    """End the runs of leaves: cancel, wait for all within one limit, close unneeded clients.

    A second call has nothing left to wait for.
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
        client._session.close_calls()  # so no client waits for another client's end
    if waited_for:
        await_ends(waited_for, grace + MARGIN)
    for client in closing:
        client.close()

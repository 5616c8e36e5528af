"""What every client that is measured has in common."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

PATIENCE = 60.0

OnFeedback = Callable[[Any], None]


class Variant:
    """One way to call an action."""

    client: Any

    def open(self, name: str) -> None:
        """Make a client and connect it to the server."""
        raise NotImplementedError

    def close(self) -> None:
        """Free everything."""
        raise NotImplementedError

    def call(self, order: int, on_feedback: OnFeedback | None) -> Any:
        """Call, wait, and return the result's sequence."""
        raise NotImplementedError

    def in_a_row(self, calls: int, order: int, on_feedback: OnFeedback | None) -> list[float]:
        """Call so often, one after the other; return the seconds that each took."""
        took = []
        for _ in range(calls):
            began = time.perf_counter()
            sequence = self.call(order, on_feedback)
            took.append(time.perf_counter() - began)
            assert len(sequence) == order + 1
        return took

    def at_once(self, goals: int, order: int) -> list[float]:
        """Have so many goals in flight at a time; return the seconds that each took."""
        raise NotImplementedError

    def is_connected(self) -> bool:
        """Whether a server is there."""
        return bool(self.client.server_is_ready())

    def await_server(self) -> bool:
        """Wait for one."""
        return bool(self.client.wait_for_server(PATIENCE))

"""What a toolbox needs to know of a human's stop."""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Callable
from typing import Any, Protocol


class Hold(Protocol):
    """Whether a human has stopped the robot. All methods from any thread."""

    def start(self) -> None:
        """Begin to listen."""

    def close(self) -> None:
        """Listen no more."""

    def why_held(self) -> str | None:
        """Return why nothing may be sent; `None` only if it is known that there is no reason."""

    @property
    def is_known(self) -> bool:
        """Whether it is known that there is a hold, or that there is none."""
        ...

    async def until_known(self, timeout: float) -> bool:
        """Wait until it is known; return whether it is."""
        ...

    def on_hold(self, callback: Callable[[str], object]) -> None:
        """Have `callback` called with the reason when a human stops the robot."""


def make_hold(domain_id: int | None) -> Hold:
    """Return what listens for a human's stop in a ROS domain."""
    if importlib.util.find_spec("actionkit.agents._hold") is None:
        return NobodyStops()
    module: Any = importlib.import_module("actionkit.agents._hold")
    return module.HoldListener(domain_id)  # type: ignore[no-any-return]


class NobodyStops:
    """Stands in where the listener is not part of the package yet; to be removed with it."""

    is_known = True

    def start(self) -> None:
        """Do nothing."""

    def close(self) -> None:
        """Do nothing."""

    def why_held(self) -> str | None:
        """Return that nothing is held."""
        return None

    async def until_known(self, timeout: float) -> bool:
        """Return at once."""
        return True

    def on_hold(self, callback: Callable[[str], object]) -> None:
        """Never call it."""

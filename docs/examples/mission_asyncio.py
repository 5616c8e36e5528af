"""The mission of mission_tree.py with plain asyncio, for those who want no tree.

python docs/examples/mission_asyncio.py [LOG]
"""

from __future__ import annotations

import asyncio
import sys
from typing import Any

from test_msgs.action import Fibonacci, NestedMessage

from actionkit import (
    ActionKitError,
    Client,
    GoalFuture,
    JsonLines,
    Timeouts,
    cancel_on_signals,
    servers,
)

SHELF = {"nested_field": {"float64_value": 3.0}}  # metres to drive
HOME = {"nested_field": {"float64_value": 1.0}}
STOPPING = Timeouts(cancel=20.0)  # the robot needs some seconds until it stands


class Robot:
    """The clients, and the battery."""

    def __init__(self, navigate: Any, pick: Any, dock: Any) -> None:
        self.navigate, self.pick, self.dock = navigate, pick, dock
        self.battery_low = asyncio.Event()
        self.once_low = False
        self.last: GoalFuture[Any, Any] | None = None

    async def send(self, client: Any, goal: Any, on_feedback: Any = None, **options: Any) -> Any:
        """Send a goal if the last one is known to have stopped, and return its result."""
        if self.last is not None and self.last.known_to_run is not False:
            raise RuntimeError(f"goal {self.last.goal_id} may still be running")
        self.last = client.call_async(goal, on_feedback, **options)
        return await self.last

    async def use_battery(self, feedback: Any) -> None:
        """Let the battery run low once, half-way to the shelf. A real one has a subscription."""
        if feedback.nested_field.float32_value >= 50.0 and not self.once_low:
            self.once_low = True
            self.battery_low.set()

    async def work(self) -> None:
        """Drive to the shelf, pick, drive home, dock."""
        await self.send(self.navigate, SHELF, self.use_battery)
        for attempt in range(1, 4):
            try:
                await self.send(self.pick, {"order": 4}, timeout=20.0)
                break
            except ActionKitError:
                if attempt == 3:
                    raise
        await self.send(self.navigate, HOME)
        await self.send(self.dock, {"order": 3}, timeout=60.0)

    async def charge(self) -> None:
        """Charge until the battery is full."""
        await self.send(self.dock, {"order": 8}, timeout=60.0)
        self.battery_low.clear()

    async def mission(self) -> None:
        """Work, and charge in between where the battery is low."""
        while True:
            working = asyncio.create_task(self.work())
            low = asyncio.create_task(self.battery_low.wait())
            try:
                await asyncio.wait({working, low}, return_when=asyncio.FIRST_COMPLETED)
                if working.done():
                    return await working
            finally:
                # Cancelling the task cancels its goal. The task ends when the server has confirmed
                # that, but after `Timeouts.cancel` at the latest.
                working.cancel()
                low.cancel()
                await asyncio.gather(working, low, return_exceptions=True)
            await self.charge()


async def run(log: str) -> None:
    """Run the mission once."""
    observer = JsonLines(log)
    async with (
        Client(NestedMessage, "navigate", timeouts=STOPPING, observers=[observer]) as navigate,
        Client(Fibonacci, "pick", observers=[observer]) as pick,
        Client(Fibonacci, "dock", observers=[observer]) as dock,
    ):
        for client in (navigate, pick, dock):
            await client.wait_for_server_async(20.0)
        await Robot(navigate, pick, dock).mission()
    observer.close()


def main(log: str) -> None:
    """Start what stands for the robot, and run the mission."""
    with (
        servers.start("navigate", action_name="navigate", speed=4.0, rate=20.0),
        servers.start("flaky", action_name="pick", fails=1, period=0.03),
        servers.start("fibonacci", action_name="dock", period=0.05),
        cancel_on_signals(),
    ):
        asyncio.run(run(log))
    print("mission SUCCESS")


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else "mission.jsonl")

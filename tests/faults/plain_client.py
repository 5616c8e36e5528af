"""A plain rclpy client with many goals, ten at a time; prints how many of them succeeded.

It shows what a network lets through, and is started by a test on the host of the client that it
is compared with: `python -m tests.faults.plain_client COUNT AT_A_TIME DEADLINE`.
"""

from __future__ import annotations

import os
import sys
import time
from typing import Any

from tests.rclpy_client import SUCCEEDED, Driver


class Calls:
    """The goals of one client, so many at a time."""

    def __init__(self, driver: Driver, count: int, at_a_time: int, deadline: float) -> None:
        self._driver = driver
        self._left = count
        self._at_a_time = at_a_time
        self._deadline = deadline
        self._open: dict[str, float] = {}
        self.succeeded = 0

    def run(self) -> None:
        """Send them all, and wait for each until its deadline."""
        while self._left or self._open:
            now = time.monotonic()
            for goal_id in [one for one, until in self._open.items() if now > until]:
                del self._open[goal_id]
            while self._left and len(self._open) < self._at_a_time:
                self._left -= 1
                goal_id, future = self._driver.send()
                self._open[goal_id] = now + self._deadline
                future.add_done_callback(lambda done, g=goal_id: self._accepted(g, done.result()))
            self._driver.executor.spin_once(0.1)

    def _accepted(self, goal_id: str, handle: Any) -> None:
        if handle.accepted:
            future = handle.get_result_async()
            future.add_done_callback(lambda done: self._ended(goal_id, done.result()))

    def _ended(self, goal_id: str, answer: Any) -> None:
        if self._open.pop(goal_id, None) is not None:
            self.succeeded += answer.status == SUCCEEDED


def main() -> None:
    count, at_a_time, deadline = (int(argument) for argument in sys.argv[1:])
    driver = Driver(int(os.environ["ROS_DOMAIN_ID"]), name="plain").connect()
    print("connected", flush=True)
    sys.stdin.readline()
    calls = Calls(driver, count, at_a_time, deadline)
    calls.run()
    print(calls.succeeded, flush=True)
    driver.close()


if __name__ == "__main__":
    main()

"""The minimum that must work on every interpreter: import, a call, a cancel, an error.

A script that needs nothing but ActionKit, rclpy and test_msgs: ``python tests/smoke.py``.
"""

from __future__ import annotations

import concurrent.futures
import os
import sys

import actionkit
from actionkit import Client, GoalRejectedError, GoalState, servers
from actionkit.testing import isolated_domain


def main() -> None:
    """Do all of it in a ROS domain of its own; an exception tells what does not work."""
    from test_msgs.action import Fibonacci

    with (
        servers.start("fibonacci", period=0.02) as server,
        Client(Fibonacci, "fibonacci") as client,
    ):
        seen: list[int] = []
        result = client.call(
            Fibonacci.Goal(order=10),
            timeout=20.0,
            on_feedback=lambda fb: seen.append(len(fb.sequence)),
        )
        assert list(result.sequence) == [0, 1, 1, 2, 3, 5, 8, 13, 21, 34, 55], result
        assert seen, "no feedback"

        future = client.call_async(Fibonacci.Goal(order=100), timeout=20.0)
        server.wait_for("executing", count=2)
        future.cancel()
        outcome = future.outcome(10.0)
        assert future.cancelled(), outcome
        assert isinstance(outcome.error, concurrent.futures.CancelledError), outcome
        assert outcome.status is GoalState.CANCELED, outcome
        server.wait_for("canceled", goal_id=str(future.goal_id))

        try:
            client.call(Fibonacci.Goal(order=-1), timeout=20.0)
        except GoalRejectedError as error:
            text = str(error)
        else:
            raise AssertionError("a rejection was taken for a success")
        assert "rejected" in text
        assert client.pending == 0
    version = ".".join(map(str, sys.version_info[:3]))
    print(f"smoke passed: actionkit {actionkit.__version__}, Python {version}")


if __name__ == "__main__":
    with isolated_domain() as domain:
        os.environ["ROS_DOMAIN_ID"] = str(domain)
        os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
        main()

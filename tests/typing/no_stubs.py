"""What users write who have no stubs. For type checkers only: nothing runs it.

mypy takes the action for `Any`; pyright reads the class that ROS generates.
"""

from __future__ import annotations

from test_msgs.action import Fibonacci  # type: ignore[import-untyped, unused-ignore]

from actionkit import Client


def calls(client: Client[Fibonacci]) -> None:
    print(client.call(Fibonacci.Goal(order=3), on_feedback=print).sequence)
    client.call({"order": 3}, on_feedback=lambda feedback: feedback.sequence)
    print(client.call_async({"order": 3}).result().sequence)


calls(Client(Fibonacci, "fibonacci"))

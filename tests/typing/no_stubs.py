"""Code of users without stubs. For type checkers only: nothing runs it.

mypy takes the action for `Any`; pyright reads the class that ROS generates.
"""

from __future__ import annotations

from test_msgs.action import Fibonacci  # type: ignore[import-untyped, unused-ignore]

from actionkit import Client
from actionkit.testing import FakeServer
from actionkit.trees import ActionBehaviour


def calls(client: Client[Fibonacci]) -> None:
    print(client.call(Fibonacci.Goal(order=3), on_feedback=print).sequence)
    client.call({"order": 3}, on_feedback=lambda feedback: feedback.sequence)
    print(client.call_async({"order": 3}).result().sequence)
    ActionBehaviour("count", client, Fibonacci.Goal(order=3))
    FakeServer(Fibonacci, "fibonacci", result=Fibonacci.Result(), feedback=[{"sequence": [1]}])


calls(Client(Fibonacci, "fibonacci"))

"""A node in another process that publishes an action's feedback and status, and serves nothing.

So does a bag that is played, a relay, or a bridge between domains.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from tests import forked

_PROGRAM = """
import sys

import rclpy
from action_msgs.msg import GoalStatusArray
from rclpy.qos import qos_profile_action_status_default as kept
from test_msgs.action import Fibonacci

rclpy.init()
node = rclpy.create_node("player")
node.create_publisher(Fibonacci.Impl.FeedbackMessage, "/fibonacci/_action/feedback", 10)
node.create_publisher(GoalStatusArray, "/fibonacci/_action/status", kept)
print("plays", flush=True)
sys.stdin.read()
rclpy.shutdown()
"""


@contextmanager
def player(environment: Mapping[str, str] | None = None) -> Iterator[None]:
    """Let the node be there; it leaves in good order."""
    with forked.Popen(
        [sys.executable, "-c", _PROGRAM],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        env=dict(os.environ if environment is None else environment),
    ) as process:
        assert process.stdout is not None
        assert b"plays\n" in process.stdout  # Fast DDS prints what is wrong there, too
        yield
        process.communicate()

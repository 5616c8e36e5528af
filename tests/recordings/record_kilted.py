"""Writes `night.jsonl`: what two actions publish on Kilted, with introspection on.

rclpy of Jazzy has no introspection of actions; https://pypi.org/project/ros-kilted-rclpy has it:

    python3 -m venv kilted
    kilted/bin/pip install 'ros-kilted-rclpy[fastrtps]' ros-kilted-test-msgs
    kilted/bin/python tests/recordings/record_kilted.py tests/recordings/night.jsonl

Each line has a topic, its type, when the message came, and the message. Two programs send
the goals, each with a DDS participant of its own: a mission and an operator.
"""

from __future__ import annotations

import base64
import json
import os
import sys
import threading
import time
from typing import Any

import rclpy
from action_msgs.msg import GoalStatusArray
from action_msgs.srv import CancelGoal
from rclpy.action import ActionClient, ActionServer, CancelResponse, GoalResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import MultiThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_system_default
from rclpy.service_introspection import ServiceIntrospectionState
from test_msgs.action import Fibonacci

ABORTS, REFUSES_CANCEL, REJECTED = 3, 9, 60
"""Orders that the servers treat in this way."""
IMPL = Fibonacci.Impl
TYPES = {
    "status": GoalStatusArray,
    "feedback": IMPL.FeedbackMessage,
    "send_goal/_service_event": IMPL.SendGoalService.Event,
    "get_result/_service_event": IMPL.GetResultService.Event,
    "cancel_goal/_service_event": CancelGoal.Event,
}
NEVER = threading.Event()


def execute(handle: Any) -> Fibonacci.Result:
    """Count up, a number each 0.1 s."""
    feedback = Fibonacci.Feedback(sequence=[0, 1])
    for _ in range(handle.request.order):
        if handle.is_cancel_requested:
            handle.canceled()
            return Fibonacci.Result(sequence=feedback.sequence)
        feedback.sequence.append(feedback.sequence[-1] + feedback.sequence[-2])
        handle.publish_feedback(feedback)
        NEVER.wait(0.1)
    (handle.abort if handle.request.order == ABORTS else handle.succeed)()
    return Fibonacci.Result(sequence=feedback.sequence)


def answer(future: Any) -> Any:
    """Wait for a future of rclpy."""
    done = threading.Event()
    future.add_done_callback(lambda _: done.set())
    done.wait(30)
    return future.result()


class Program:
    """A node with a participant of its own, and its clients."""

    def __init__(self, name: str) -> None:
        self.context = rclpy.Context()
        rclpy.init(context=self.context)
        self.node = rclpy.create_node(name, context=self.context)
        self.group = ReentrantCallbackGroup()
        self.clients: dict[str, Any] = {}
        self.executor = MultiThreadedExecutor(8, context=self.context)
        self.executor.add_node(self.node)

    def introspected(self, end: Any) -> Any:
        """Return a client or server, with introspection on."""
        clock, contents = self.node.get_clock(), ServiceIntrospectionState.CONTENTS
        end.configure_introspection(clock, qos_profile_system_default, contents)
        return end

    def client(self, name: str) -> None:
        """Make a client."""
        client = ActionClient(self.node, Fibonacci, name, callback_group=self.group)
        self.clients[name] = self.introspected(client)

    def serve(self, name: str) -> None:
        """Make a server."""

        def accepts(goal: Any) -> GoalResponse:
            return GoalResponse.REJECT if goal.order == REJECTED else GoalResponse.ACCEPT

        def cancels(handle: Any) -> CancelResponse:
            refuses = handle.request.order == REFUSES_CANCEL
            return CancelResponse.REJECT if refuses else CancelResponse.ACCEPT

        server = ActionServer(
            self.node,
            Fibonacci,
            name,
            execute,
            callback_group=self.group,
            goal_callback=accepts,
            cancel_callback=cancels,
        )
        self.clients[f"server of {name}"] = self.introspected(server)

    def record(self, topic: str, cls: Any, lines: list[str]) -> None:
        """Write down the messages of a topic."""
        package, kind = cls.__module__.split(".")[:2]
        name = f"{package}/{kind}/{cls.__name__}"

        def write(data: bytes) -> None:
            encoded = base64.b64encode(data).decode()
            lines.append(json.dumps([topic, name, time.time_ns(), encoded]))

        qos = QoSProfile(depth=100)
        if topic.endswith("status"):
            qos.durability = DurabilityPolicy.TRANSIENT_LOCAL
        self.node.create_subscription(cls, topic, write, qos, raw=True)

    def spin(self) -> None:
        """Begin to communicate."""
        threading.Thread(target=self.executor.spin, daemon=True).start()

    def send(self, name: str, order: int) -> Any:
        """Send a goal; return rclpy's handle."""
        return answer(self.clients[name].send_goal_async(Fibonacci.Goal(order=order)))


def main(path: str) -> None:
    """Run the goals, and write what was published."""
    robot, mission, operator, recorder = map(Program, ("robot", "mission", "operator", "recorder"))
    lines: list[str] = []
    for action in ("navigate", "move_arm"):
        for kind, cls in TYPES.items():
            recorder.record(f"/{action}/_action/{kind}", cls, lines)
        robot.serve(action)
        mission.client(action)
        operator.client(action)
    for program in (recorder, robot, mission, operator):
        program.spin()
    for program in (mission, operator):
        for client in program.clients.values():
            client.wait_for_server()
    NEVER.wait(2)  # until the recorder has discovered all

    for action, order in (("navigate", 8), ("move_arm", 5), ("move_arm", ABORTS)):
        answer(mission.send(action, order).get_result_async())
    operator.send("move_arm", REJECTED)
    drives, moves = mission.send("navigate", 12), mission.send("move_arm", 20)
    also_moves = operator.send("move_arm", REFUSES_CANCEL)
    NEVER.wait(0.3)  # while they run
    answer(mission.clients["move_arm"]._cancel_goal_async(also_moves))
    answer(operator.clients["move_arm"]._cancel_goal_async(moves))
    for handle in (drives, moves, also_moves):
        answer(handle.get_result_async())
    answer(moves.cancel_goal_async())
    mission.send("move_arm", 50)
    NEVER.wait(1)  # it still runs at the end of the recording
    with open(path, "w", encoding="utf-8") as file:
        file.write("\n".join(lines) + "\n")
    os._exit(0)  # the last goal runs


if __name__ == "__main__":
    main(sys.argv[1])

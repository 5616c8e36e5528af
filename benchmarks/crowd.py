"""A process with many idle clients on one context: ActionKit's, rclpy's, or bare entities."""

from __future__ import annotations

import sys
import threading
from typing import Any

from rclpy.action import ActionClient
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile, qos_profile_services_default
from test_msgs.action import Fibonacci

from actionkit._ros.workarounds.listener_hang import stop_listening
from benchmarks import child
from benchmarks.server import NAME


class OfActionKit:
    """Clients of ActionKit."""

    def __init__(self) -> None:
        self._clients: list[Any] = []

    def open(self, number: int) -> None:
        """Make so many more."""
        from actionkit import Client

        for _ in range(number):
            self._clients.append(Client(Fibonacci, NAME))
        for client in self._clients:
            assert client.wait_for_server(60)

    def close(self) -> None:
        """Close them."""
        for client in self._clients:
            client.close()


class OfRclpy:
    """rclpy's action clients on a node that a thread spins."""

    spun = True

    def __init__(self) -> None:
        self._context = Context()
        self._context.init(args=[], initialize_logging=False)
        self._node = Node(
            "crowd", context=self._context, enable_rosout=False, start_parameter_services=False
        )
        self._kept: list[Any] = []
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._spinner = threading.Thread(target=self._executor.spin, daemon=True)

    def open(self, number: int) -> None:
        """Make so many more."""
        for _ in range(number):
            self._kept.append(self.make(self._node))
        if self.spun and not self._spinner.is_alive():
            self._spinner.start()

    def make(self, node: Node) -> Any:
        """Make one."""
        return ActionClient(node, Fibonacci, NAME)

    def close(self) -> None:
        """Leave the graph."""
        self._executor.shutdown()
        if self._spinner.is_alive():
            self._spinner.join()
        stop_listening(self._node)
        self._node.destroy_node()
        self._context.shutdown()


class OfEntities(OfRclpy):
    """What no action client can do without: three service clients and a subscription."""

    spun = False

    def make(self, node: Node) -> Any:
        """Make them, with queues of rclpy's usual depth."""
        impl = Fibonacci.Impl
        from action_msgs.srv import CancelGoal

        services = ((impl.SendGoalService, "send_goal"), (impl.GetResultService, "get_result"))
        return [
            *(
                node.create_client(
                    kind, f"{NAME}/_action/{name}", qos_profile=qos_profile_services_default
                )
                for kind, name in (*services, (CancelGoal, "cancel_goal"))
            ),
            node.create_subscription(
                impl.FeedbackMessage,
                f"{NAME}/_action/feedback",
                lambda _: None,
                QoSProfile(depth=10),
                raw=True,
            ),
        ]


KINDS = {"ActionKit": OfActionKit, "rclpy": OfRclpy, "entities": OfEntities}

if __name__ == "__main__":
    answers = child.claim_stdout()
    crowd = KINDS[sys.argv[1]]()
    child.serve(answers, {"open": crowd.open})
    crowd.close()

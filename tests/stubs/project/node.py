"""A node as users write it, with rclpy's own types beside the stubs. For type checkers only."""
# pyright: standard
# mypy: disable-error-code="no-untyped-call"

from __future__ import annotations

import rclpy
import test_msgs.message_fixtures
from rclpy.action.client import ActionClient
from rclpy.action.server import ActionServer, ServerGoalHandle
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile, qos_profile_sensor_data
from std_msgs.msg import String
from std_msgs.msg._string import String as TheSame
from test_msgs.action import Fibonacci
from test_msgs.srv import BasicTypes

from actionkit import Client


class Mine(Node):
    def __init__(self) -> None:
        super().__init__("mine", parameter_overrides=[Parameter("a", value=1)])
        self.text = self.create_publisher(String, "text", QoSProfile(depth=1))
        self.create_subscription(String, "text", self.on_text, qos_profile_sensor_data)
        self.service = self.create_service(BasicTypes, "basic", self.on_request)
        self.client = self.create_client(BasicTypes, "basic")
        self.actions = ActionClient(self, Fibonacci, "fibonacci")
        self.server = ActionServer(self, Fibonacci, "fibonacci", self.execute)
        self.timer = self.create_timer(1.0, lambda: self.text.publish(TheSame(data="a")))
        self.kit = Client(Fibonacci, "fibonacci", node=self)

    def on_text(self, message: String) -> None:
        self.get_logger().info(message.data)

    def on_request(
        self, request: BasicTypes.Request, response: BasicTypes.Response
    ) -> BasicTypes.Response:
        response.int8_value = request.int8_value
        return response

    def execute(self, handle: ServerGoalHandle) -> Fibonacci.Result:
        handle.succeed()
        return Fibonacci.Result()


rclpy.init()
rclpy.spin(Mine())
rclpy.shutdown()
print(test_msgs.message_fixtures)

from typing import Any

from rclpy import _rclpy_pybind11
from rclpy.event_handler import EventHandler

class Subscription:
    msg_type: Any
    topic: str
    event_handlers: list[EventHandler]
    @property
    def handle(self) -> _rclpy_pybind11.Subscription: ...
    @property
    def topic_name(self) -> str: ...
    def get_publisher_count(self) -> int: ...
    def destroy(self) -> None: ...

from collections.abc import Callable
from typing import Any

from rclpy._rclpy_pybind11 import UnsupportedEventTypeError as UnsupportedEventTypeError
from rclpy._rclpy_pybind11 import WaitSet, rmw_matched_status_t

QoSSubscriptionMatchedInfo = rmw_matched_status_t

class EventHandler:
    callback: Callable[[Any], object]
    event_type: Any
    def is_ready(self, wait_set: WaitSet) -> bool: ...
    def take_data(self) -> Any: ...
    def add_to_wait_set(self, wait_set: WaitSet) -> None: ...
    def destroy(self) -> None: ...

class SubscriptionEventCallbacks:
    def __init__(
        self,
        *,
        deadline: Callable[[Any], object] | None = None,
        incompatible_qos: Callable[[Any], object] | None = None,
        liveliness: Callable[[Any], object] | None = None,
        message_lost: Callable[[Any], object] | None = None,
        incompatible_type: Callable[[Any], object] | None = None,
        matched: Callable[[QoSSubscriptionMatchedInfo], object] | None = None,
        use_default_callbacks: bool = True,
    ) -> None: ...

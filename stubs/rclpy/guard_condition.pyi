from collections.abc import Callable

from rclpy import _rclpy_pybind11
from rclpy.callback_groups import CallbackGroup
from rclpy.context import Context

class GuardCondition:
    def __init__(
        self,
        callback: Callable[[], object] | None,
        callback_group: CallbackGroup | None,
        context: Context | None = None,
    ) -> None: ...
    @property
    def handle(self) -> _rclpy_pybind11.GuardCondition: ...
    def trigger(self) -> None: ...
    def destroy(self) -> None: ...

"""The part of rclpy that ActionKit uses, typed: rclpy's own annotations leave most of it open.

Modules that are not here are read from the installed rclpy.
"""

from rclpy._rclpy_pybind11 import SignalHandlerOptions
from rclpy.context import Context

def init(
    *,
    args: list[str] | None = None,
    context: Context | None = None,
    domain_id: int | None = None,
    signal_handler_options: SignalHandlerOptions | None = None,
) -> None: ...
def ok(*, context: Context | None = None) -> bool: ...
def shutdown(*, context: Context | None = None, uninstall_handlers: bool | None = None) -> None: ...

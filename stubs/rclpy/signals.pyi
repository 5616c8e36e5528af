from rclpy.context import Context
from rclpy.guard_condition import GuardCondition

class SignalHandlerGuardCondition(GuardCondition):
    def __init__(self, context: Context | None = None) -> None: ...

"""Reference servers that fail, each in its own way."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from actionkit.servers._behaviours.basic import Countdown, Fibonacci, compute, fibonacci_steps
from actionkit.servers._behaviours.behaviour import Behaviour, Process
from actionkit.servers._behaviours.scripted import Preset
from actionkit.servers._run import Run


class Silent(Preset):
    """Never answers a goal request; still answers requests to cancel."""

    steps = ("no_answer",)


class NeverFinishes(Preset):
    """One feedback, then executes until it is cancelled."""

    steps = ("ignore_cancel", {"feedback": [0]}, "heed_cancel", "never")


class RefusesCancel(Countdown):
    """Counts down and refuses every request to cancel, as rclpy does by default."""

    any_type = True

    def may_cancel(self, run: Run) -> bool:
        return False


class IgnoresCancel(Countdown):
    """Counts down, accepts requests to cancel, goes on all the same and succeeds."""

    any_type = True

    def received(self, run: Run) -> None:
        run.heeds_cancel = False


class SlowCancel(Behaviour):
    """Executes until cancelled; then takes `delay` seconds (gate=1: until released) to stop."""

    any_type = True
    options: ClassVar = {"delay": 1.0, "gate": 0}

    def execute(self, run: Run) -> object:
        run.heeds_cancel = False
        run.feedback([0])
        run.wait_cancel()
        if self.option["gate"]:
            run.wait_gate()
        else:
            run.pause(self.option["delay"])
        return run.canceled()


class Aborts(Behaviour):
    """Aborts after `order` feedbacks, with the sequence so far as the result."""

    any_type = True
    options: ClassVar = {"period": 0.0}

    def execute(self, run: Run) -> object:
        compute(run, fibonacci_steps(run.order + 1), self.option["period"])
        return run.abort()


class Raises(Preset):
    """Raises an exception while it executes: rclpy aborts the goal with an empty result."""

    steps = ("ignore_cancel", "raise")


class NoResult(Preset):
    """Succeeds and returns None: rclpy then never sends a result."""

    steps = ("ignore_cancel", "no_result")


class CancelsItself(Preset):
    """Ends CANCELED though its client did not ask: another client, in the server process, did."""

    steps = ("ignore_cancel", {"feedback": [0]}, "cancel_itself", "heed_cancel", "never")


class Blocking(Behaviour):
    """Blocks the only thread of its executor for `delay` seconds (gate=1: until released).

    Answers nothing meanwhile; then succeeds.
    """

    any_type = True
    options: ClassVar = {"threads": 1, "delay": 2.0, "gate": 0}

    def execute(self, run: Run) -> object:
        run.heeds_cancel = False
        if self.option["gate"]:
            run.wait_gate()
        else:
            run.pause(self.option["delay"])
        return run.succeed([0, 1])


class WrongType(Behaviour):
    """Serves the name with another type, test_msgs/action/NestedMessage, or the one it is given."""

    any_type = True
    action_type = "test_msgs/action/NestedMessage"

    def execute(self, run: Run) -> object:
        return run.succeed()


class Crashes(Fibonacci):
    """Kills itself (SIGKILL) at a `point`: before_accept, after_accept, feedback, before_result.

    after_accept: the acceptance was sent, nothing executes yet. feedback: after the first feedback.
    before_result: the goal is SUCCEEDED, but its result was not sent.
    """

    any_type = True
    options: ClassVar = {**Fibonacci.options, "point": "feedback"}

    def __init__(self, options: Mapping[str, Any], process: Process) -> None:
        super().__init__(options, process)
        points = ("before_accept", "after_accept", "feedback", "before_result")
        if options["point"] not in points:
            raise ValueError(f"point={options['point']!r} is not one of {', '.join(points)}")

    def decide(self, run: Run) -> bool:
        self._crash_at("before_accept", run)
        return super().decide(run)

    def accepted(self, run: Run) -> None:
        self._crash_at("after_accept", run)

    def execute_to_end(self, run: Run) -> object:
        if self.option["point"] == "feedback":
            run.feedback([0, 1])
            self._crash_at("feedback", run)
        result = super().execute_to_end(run)
        self._crash_at("before_result", run)
        return result

    def _crash_at(self, point: str, run: Run) -> None:
        if self.option["point"] == point:
            self.life.crash(run, point)


class Expires(Fibonacci):
    """Forgets its results almost at once (after `result_timeout` = 0.01 seconds)."""

    any_type = True
    options: ClassVar = {**Fibonacci.options, "result_timeout": 0.01}


class Vanishes(Behaviour):
    """Destroys its action server while the first goal executes; its process and node stay.

    It waits until the goal's result is asked for or, with gate=1, until it is released: earlier,
    the acceptance itself could be lost with the server.
    """

    any_type = True
    options: ClassVar = {"gate": 0}

    def execute(self, run: Run) -> object:
        if self.option["gate"]:
            run.wait_gate()
        else:
            run.wait_result_request()
        self.process.destroy_server(run.server)
        run.emit("vanished")
        run.wait_forever()
        return None

"""Servers that fail, each in one way of its own."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from ._behaviours_basic import Countdown, Fibonacci, fibonacci_steps
from ._registry import Behaviour, Process, server
from ._run import Run


@server
class Silent(Behaviour):
    """Never answers a goal request; still answers requests to cancel."""

    decides_slowly = True

    def decide(self, run: Run) -> bool:
        run.wait_forever()
        return False


@server
class NeverFinishes(Behaviour):
    """One feedback, then executes until it is cancelled."""

    def execute(self, run: Run) -> object:
        run.feedback([0])
        run.wait_cancel()
        return run.canceled([0])


@server
class RefusesCancel(Countdown):
    """Counts down and refuses every request to cancel, as rclpy does by default."""

    def may_cancel(self, run: Run) -> bool:
        return False


@server
class IgnoresCancel(Countdown):
    """Counts down, accepts requests to cancel, goes on all the same and succeeds."""

    def execute(self, run: Run) -> object:
        remaining = list(range(run.order, -1, -1))
        while len(remaining) > 1:
            run.rest(self.option["period"])
            del remaining[0]
            run.feedback(remaining)
        if self.option["gate"]:
            run.wait_gate(heed_cancel=False)
        return run.succeed(remaining)


@server
class SlowCancel(Behaviour):
    """Executes until cancelled; then takes `delay` seconds (gate=1: until released) to stop."""

    options: ClassVar = {"delay": 1.0, "gate": 0}

    def execute(self, run: Run) -> object:
        run.feedback([0])
        run.wait_cancel()
        if self.option["gate"]:
            run.wait_gate(heed_cancel=False)
        else:
            run.rest(self.option["delay"])
        return run.canceled([0])


@server
class Aborts(Behaviour):
    """Aborts after `order` feedbacks, with the sequence so far as the result."""

    options: ClassVar = {"period": 0.0}

    def execute(self, run: Run) -> object:
        sequence = [0, 1]
        for sequence in fibonacci_steps(run.order + 1):  # the last is the result
            if run.pause(self.option["period"]):
                return run.canceled(sequence)
            run.feedback(sequence)
        return run.abort(sequence)


@server
class Raises(Behaviour):
    """Raises an exception while it executes: rclpy aborts the goal with an empty result."""

    def execute(self, run: Run) -> object:
        # rclpy ends the goal, after this; nothing of ours runs by then.
        run.emit("aborted", raised=True)
        raise ValueError("this reference server raises on purpose")


@server
class NoResult(Behaviour):
    """Succeeds and returns None: rclpy then never sends a result."""

    def execute(self, run: Run) -> object:
        run.succeed()
        return None


@server
class CancelsItself(Behaviour):
    """Ends CANCELED though its client did not ask: another client, in the server process, did."""

    def __init__(self, options: Mapping[str, Any], process: Process) -> None:
        super().__init__(options, process)
        process.enable_self_cancel()

    def execute(self, run: Run) -> object:
        run.feedback([0])
        self.process.cancel_from_elsewhere(run.goal_id)
        run.wait_cancel()
        return run.canceled([0])


@server
class Blocking(Behaviour):
    """Blocks the only thread of its executor for `delay` seconds (gate=1: until released).

    Answers nothing meanwhile; then succeeds.
    """

    options: ClassVar = {"threads": 1, "delay": 2.0, "gate": 0}

    def execute(self, run: Run) -> object:
        if self.option["gate"]:
            run.wait_gate()
        else:
            run.rest(self.option["delay"])
        return run.succeed([0, 1])


@server
class WrongType(Behaviour):
    """Serves the name with another type, test_msgs/action/NestedMessage."""

    action_type = "test_msgs.action:NestedMessage"

    def execute(self, run: Run) -> object:
        return run.succeed()


@server
class Crashes(Fibonacci):
    """Kills itself (SIGKILL) at a `point`: before_accept, after_accept, feedback, before_result.

    after_accept: the acceptance was sent, nothing executed. feedback: after the first one.
    before_result: the goal has reached SUCCEEDED, its result was not sent.
    """

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

    def execute(self, run: Run) -> object:
        if self.option["point"] == "feedback":
            run.feedback([0, 1])
            self._crash_at("feedback", run)
        result = super().execute(run)
        self._crash_at("before_result", run)
        return result

    def _crash_at(self, point: str, run: Run) -> None:
        if self.option["point"] == point:
            self.process.crash(run, point)


@server
class Expires(Fibonacci):
    """Forgets its results almost at once (after `result_timeout` = 0.01 seconds)."""

    options: ClassVar = {**Fibonacci.options, "result_timeout": 0.01}


@server
class Vanishes(Behaviour):
    """Destroys its action server while the first goal executes; its process and node stay.

    It does so once the goal's result is asked for, or, with gate=1, when released: any sooner,
    the acceptance itself could be lost with the server.
    """

    options: ClassVar = {"gate": 0}

    def execute(self, run: Run) -> object:
        if run.wait_gate() if self.option["gate"] else run.wait_result_request():
            return run.canceled()
        self.process.destroy_server(run.server)
        run.emit("vanished")
        run.wait_forever()
        return None

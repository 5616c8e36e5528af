"""Reference servers that work."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from typing import ClassVar

from actionkit.servers._behaviours import own_types
from actionkit.servers._behaviours.behaviour import Behaviour
from actionkit.servers._run import Run

_INT32 = 2**31
"""int32 fields hold smaller numbers; from its 48th number on, the true sequence exceeds this."""


def fibonacci_steps(order: int) -> Iterator[list[int]]:
    """Yield the growing sequence of the ROS tutorial: 0, 1, then one more number in each step.

    Numbers are modulo 2**31, so that they fit into an int32, also for an order above 46.
    """
    sequence = [0, 1]
    for _ in range(1, order):
        sequence = [*sequence, (sequence[-1] + sequence[-2]) % _INT32]
        yield sequence


def compute(
    run: Run, steps: Iterable[list[int]], period: float, *, feedback: object = True
) -> None:
    """Do the steps one after the other: each waits `period` seconds, then publishes feedback.

    Raises:
        GoalStopped: The goal must stop; the current step is its result.
    """
    run.content = [0, 1]
    for sequence in steps:
        run.content = sequence
        run.pause(period)
        if feedback:
            run.feedback(sequence)


class Fibonacci(Behaviour):
    """As the tutorial's, concurrent: each goal has its own feedback and its own cancel.

    Order n gives n - 1 feedbacks and n + 1 numbers (modulo 2**31). Rejects negative orders, and
    orders above `max_order`. `period`: seconds per step. `gate=1`: goals wait before they succeed
    until released. `feedback=0`: no feedback. `cancel_takes`: seconds that the server needs for
    each request to cancel; meanwhile it answers no other request.
    """

    options: ClassVar = {
        "period": 0.0,
        "gate": 0,
        "feedback": 1,
        "max_order": 100,
        "cancel_takes": 0.0,
    }
    gate_at_end: ClassVar[bool] = True
    """Whether the gate, if there is one, is before the end (and not in another place)."""

    def decide(self, run: Run) -> bool:
        return 0 <= run.order <= int(self.option["max_order"])

    def may_cancel(self, run: Run) -> bool:
        # Not run.pause(): that is for the thread of the goal, which goes on.
        time.sleep(self.option["cancel_takes"])
        return True

    def execute(self, run: Run) -> object:
        self.compute(run, fibonacci_steps(run.order))
        if self.gate_at_end and self.option["gate"]:
            run.wait_gate()
        run.pause(0)
        return run.succeed()

    def compute(self, run: Run, steps: Iterable[list[int]]) -> None:
        """Do the steps with the settings of the options."""
        compute(run, steps, self.option["period"], feedback=self.option["feedback"])


class Twins(Fibonacci):
    """Two fibonacci servers on the one name: both execute every goal; `server` tells which."""

    any_type = True
    servers = 2


class Countdown(Behaviour):
    """Counts down from `order`, one feedback and `period` seconds per step.

    Feedback and result hold the numbers that remain: ``[2, 1, 0]`` after the first step from 3,
    ``[0]`` at the end. `gate=1`: goals wait before they succeed until released.
    With the type actionkit_interfaces/action/Countdown, it counts down from `target`, and its
    feedback has the `current_count`.
    """

    options: ClassVar = {"period": 0.1, "gate": 0, "max_order": 10_000}
    other_types = (own_types.COUNTDOWN,)

    def decide(self, run: Run) -> bool:
        return 0 <= _start(run) <= int(self.option["max_order"])

    def execute(self, run: Run) -> object:
        own = own_types.is_own(run.goal)
        for left in range(_start(run), -1, -1):
            remaining = list(range(left, -1, -1))
            if left < _start(run):
                run.feedback({"current_count": left} if own else remaining)
            run.content = own_types.counted(run.goal, left) if own else remaining
            if left:
                run.pause(self.option["period"])
        if self.option["gate"]:
            run.wait_gate()
        run.pause(0)
        return run.succeed()


def _start(run: Run) -> int:
    return int(run.goal.target) if own_types.is_own(run.goal) else run.order


class SlowAccept(Fibonacci):
    """Takes `delay` seconds (gate=1: until released) to accept; then as fibonacci.

    Requests to cancel are answered meanwhile.
    """

    any_type = True
    options: ClassVar = {**Fibonacci.options, "delay": 3.0}
    decides_slowly = True
    gate_at_end = False

    def decide(self, run: Run) -> bool:
        if self.option["gate"]:
            run.wait_gate()
        else:
            run.pause(self.option["delay"])
        return super().decide(run)

"""Servers that do their work well."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import ClassVar

from ._registry import Behaviour, server
from ._run import Run

# int32 fields take no more; the true sequence leaves them at its 47th number.
_INT32 = 2**31


def fibonacci_steps(order: int) -> Iterator[list[int]]:
    """The sequence so far, as of the ROS tutorial: 0, 1, then one number more per step.

    Numbers are modulo 2**31, so that an order beyond 46 overflows no int32.
    """
    sequence = [0, 1]
    for _ in range(1, order):
        sequence.append((sequence[-1] + sequence[-2]) % _INT32)
        yield sequence


@server
class Fibonacci(Behaviour):
    """As the tutorial's, concurrent: each goal has its own feedback and its own cancel.

    Order n gives n - 1 feedbacks and n + 1 numbers (modulo 2**31). Rejects negative orders, and
    those above `max_order`. `period`: seconds per step. `gate=1`: goals wait before they succeed
    until released. `feedback=0`: none. `cancel_takes`: seconds that the server thinks about each
    request to cancel, in which it answers no other.
    """

    options: ClassVar = {
        "period": 0.0,
        "gate": 0,
        "feedback": 1,
        "max_order": 100,
        "cancel_takes": 0.0,
    }
    #: Whether the gate, if there is one, stands before the end (and not somewhere else).
    gate_at_end: ClassVar[bool] = True

    def decide(self, run: Run) -> bool:
        return 0 <= run.order <= int(self.option["max_order"])

    def may_cancel(self, run: Run) -> bool:
        # Not run.rest(): its waits belong to the thread of the goal, which goes on.
        time.sleep(self.option["cancel_takes"])
        return True

    def execute(self, run: Run) -> object:
        sequence = [0, 1]
        for sequence in fibonacci_steps(run.order):  # the last is the result
            if run.pause(self.option["period"]):
                return run.canceled(sequence)
            if self.option["feedback"]:
                run.feedback(sequence)
        if self.gate_at_end and self.option["gate"] and run.wait_gate():
            return run.canceled(sequence)
        return run.canceled(sequence) if run.cancelled else run.succeed(sequence)


@server
class Twins(Fibonacci):
    """Two fibonacci servers on the one name: both execute every goal; `server` tells which."""

    servers = 2


@server
class Countdown(Behaviour):
    """Counts down from `order`, one feedback and `period` seconds per step.

    Feedback and result hold the numbers that remain: ``[2, 1, 0]`` after the first step from 3,
    ``[0]`` at the end. `gate=1`: goals wait before they succeed until released.
    """

    options: ClassVar = {"period": 0.1, "gate": 0, "max_order": 10_000}

    def decide(self, run: Run) -> bool:
        return 0 <= run.order <= int(self.option["max_order"])

    def execute(self, run: Run) -> object:
        remaining = list(range(run.order, -1, -1))
        while len(remaining) > 1:
            if run.pause(self.option["period"]):
                return run.canceled(remaining)
            del remaining[0]
            run.feedback(remaining)
        if self.option["gate"] and run.wait_gate():
            return run.canceled(remaining)
        return run.canceled(remaining) if run.cancelled else run.succeed(remaining)


@server
class SlowAccept(Fibonacci):
    """Takes `delay` seconds (gate=1: until released) to accept; then as fibonacci.

    Requests to cancel are answered meanwhile.
    """

    options: ClassVar = {**Fibonacci.options, "delay": 3.0}
    decides_slowly = True
    gate_at_end = False

    def decide(self, run: Run) -> bool:
        if self.option["gate"]:
            run.wait_gate()
        else:
            run.rest(self.option["delay"])
        return super().decide(run)

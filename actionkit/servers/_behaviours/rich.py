"""Reference servers with rich messages: fields of many types, codes, much feedback."""

from __future__ import annotations

import contextlib
import math
import sys
import time
from collections.abc import Mapping
from typing import Any, ClassVar

from actionkit.servers._behaviours import own_types
from actionkit.servers._behaviours.behaviour import Behaviour, Process
from actionkit.servers._run import Content, GoalStopped, Run

_NESTED = "test_msgs/action/NestedMessage"
_PLANNING, _MOVING, _ARRIVED, _STOPPED = range(4)
"""The values of `nested_field.uint8_value` of `navigate`."""
_WORDS = ("planning", "moving", "arrived", "stopped")
"""The same in `status_message`, with the type of actionkit_interfaces."""


class Navigate(Behaviour):
    """Drives `distance` metres, with rich feedback at `rate` Hz; on test_msgs/action/NestedMessage.

    The fields of NestedMessage and their meanings:

    =========================================  =====================  ==========================
    field                                      in the goal            in feedback and result
    =========================================  =====================  ==========================
    nested_field.float64_value                 distance in m          distance that remains in m
    nested_field.float32_value                 speed in m/s           percent done, 0 to 100
    nested_field_no_pkg.duration_value         -                      estimated time to arrival
    nested_field.uint8_value                   -                      status, see below
    nested_field.uint32_value                  -                      number of the feedback
    =========================================  =====================  ==========================

    In a goal, 0 means the options `distance` = 5 and `speed` = 1. Status: 0 planning (the first
    feedback), 1 moving, 2 arrived, 3 stopped (by a cancel). Each feedback is one step,
    `speed` / `rate` metres; the last says 100 percent. Rejects values that are negative or not
    finite. gate=1: goals wait before they succeed until released.

    With the type actionkit_interfaces/action/NavigateToPose, the robot starts at zero; `distance`
    is not used, and `speed` only if `max_velocity` is 0.
    """

    action_type = _NESTED
    options: ClassVar = {
        "distance": 5.0,
        "speed": 1.0,
        "rate": 10.0,
        "gate": 0,
    }
    other_types = (own_types.NAVIGATE,)

    def __init__(self, options: Mapping[str, Any], process: Process) -> None:
        super().__init__(options, process)
        for name in ("distance", "speed", "rate"):
            if not 0 < options[name] < math.inf:
                raise ValueError(f"{name}={options[name]!r} is not a positive number")

    def decide(self, run: Run) -> bool:
        if own_types.is_own(run.goal):
            reason = own_types.refusal(run.goal)
            return reason is None or run.refuse(reason)
        asked = run.goal.nested_field
        for name, value in (("distance", asked.float64_value), ("speed", asked.float32_value)):
            if not 0 <= value < math.inf:
                return run.refuse(f"{name} {value}")
        return True

    def execute(self, run: Run) -> object:
        began = time.monotonic()
        distance, speed = self._way(run)
        steps = max(1, math.ceil(distance / speed * self.option["rate"]))
        own = own_types.is_own(run.goal)

        def position(done: int, status: int) -> Content:
            if own:
                seconds = distance * (1 - done / steps) / speed
                return own_types.driving(run.goal, done / steps, seconds, _WORDS[status])
            return _position(distance, speed, done, steps, status)

        def result(done: int, status: int) -> Content:
            if own:
                return own_types.drove(run.goal, done / steps, time.monotonic() - began)
            return _position(distance, speed, done, steps, status)

        for done in range(steps + 1):
            run.feedback(
                position(done, _PLANNING if done == 0 else _MOVING if done < steps else _ARRIVED)
            )
            run.content = result(done, _STOPPED)
            if done < steps:
                run.pause(1 / self.option["rate"])
        if self.option["gate"]:
            run.wait_gate()
        run.pause(0)
        return run.succeed(result(steps, _ARRIVED))

    def _way(self, run: Run) -> tuple[float, float]:
        """Return how far to drive, in m, and how fast, in m/s."""
        if own_types.is_own(run.goal):
            distance = math.hypot(*own_types.way(run.goal))
            return distance, run.goal.max_velocity or self.option["speed"]
        asked = run.goal.nested_field
        return (
            asked.float64_value or self.option["distance"],
            asked.float32_value or self.option["speed"],
        )


def _position(distance: float, speed: float, done: int, steps: int, status: int) -> Content:
    remains = distance * (1 - done / steps)
    seconds = math.floor(remains / speed)
    return {
        "nested_field.float64_value": remains,
        "nested_field.float32_value": 100 * done / steps,
        "nested_field_no_pkg.duration_value.sec": min(seconds, 2**31 - 1),
        "nested_field_no_pkg.duration_value.nanosec": int((remains / speed - seconds) * 1e9),
        "nested_field.uint8_value": status,
        "nested_field.uint32_value": done,
    }


class ErrorCode(Behaviour):
    """Ends with the error code that the goal asks for; on test_msgs/action/NestedMessage.

    The code is `nested_field.int32_value` of the goal and of the result; the result's
    `nested_field.bool_value` says whether it is 0. With 0 the goal ends as SUCCEEDED, otherwise as
    ABORTED or, with ends=succeeded, as SUCCEEDED, too. codes=102,102,0: the server chooses the
    code, one for each goal in turn, also over restarts; the last one repeats. `period`: seconds for
    each goal.
    """

    action_type = _NESTED
    options: ClassVar = {"codes": "", "ends": "aborted", "period": 0.0}
    choices: ClassVar = {"ends": ("aborted", "succeeded")}

    @classmethod
    def parse(
        cls, given: Mapping[str, str], *, foreign: bool = False
    ) -> dict[str, int | float | str]:
        options = super().parse(given, foreign=foreign)
        _codes(str(options["codes"]))
        return options

    def execute(self, run: Run) -> object:
        codes = _codes(self.option["codes"]) or [run.goal.nested_field.int32_value]
        code = codes[min(run.number, len(codes) - 1)]
        run.content = {"nested_field.int32_value": code, "nested_field.bool_value": code == 0}
        run.pause(self.option["period"])
        return run.succeed() if code == 0 or self.option["ends"] == "succeeded" else run.abort()


def _codes(text: str) -> list[int]:
    try:
        codes = [int(code) for code in text.split(",")] if text.strip() else []
    except ValueError:
        raise ValueError(f"option codes={text!r} is not a list of numbers, as 102,102,0") from None
    for code in codes:
        if not -(2**31) <= code < 2**31:
            raise ValueError(f"option codes={text!r}: {code} does not fit into an int32")
    return codes


class Floods(Behaviour):
    """Publishes `order` feedbacks as fast as it can, or at `rate` Hz; then succeeds.

    The feedbacks are ``[0]``, ``[1]``, ...; with `size` > 1, they are padded to that many numbers.
    The result is how many were published. The journal has "feedback" only for the first one, and
    "flooded" (`n`, `seconds`) at the end. Requests, also to cancel, are answered meanwhile.
    """

    any_type = True
    options: ClassVar = {"rate": 0.0, "size": 1}

    def __init__(self, options: Mapping[str, Any], process: Process) -> None:
        super().__init__(options, process)
        # Seconds for which one thread may block the others, a tenth of Python's default. A thread
        # that floods never waits, and the answer to a request needs several turns of its thread.
        sys.setswitchinterval(0.0005)

    def may_cancel(self, run: Run) -> bool:
        # The flood takes the goal's lock so often that the cancel might never get it.
        run.notes = "rest"
        return True

    def execute(self, run: Run) -> object:
        began = time.monotonic()
        padding = [0] * (self.option["size"] - 1)
        rate = self.option["rate"]
        sent = 0
        with contextlib.suppress(GoalStopped):
            while sent < run.order and not run.cancelled:
                if rate:
                    run.pause(began + sent / rate - time.monotonic())
                if run.notes:
                    run.pause(1)  # second; the cancel comes earlier and ends the pause
                run.feedback([sent, *padding], journal=sent == 0)
                sent += 1
        run.emit("flooded", n=sent, seconds=round(time.monotonic() - began, 6))
        run.content = [sent]
        return run.canceled() if run.cancelled else run.succeed()

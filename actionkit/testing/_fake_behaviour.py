# rclpy has annotations here and there only.
# mypy: disable-error-code="no-untyped-call"
"""Serves the goals of a fake server. Imports rclpy, so it is imported late."""

from __future__ import annotations

import os
import re
import threading
from collections.abc import Callable, Mapping
from typing import Any

from rclpy.action.server import GoalEvent
from rclpy.exceptions import InvalidTopicNameException
from rclpy.validate_topic_name import validate_topic_name

from actionkit.servers._behaviours.behaviour import COMMON_OPTIONS, Behaviour, Process
from actionkit.servers._life import Life
from actionkit.servers._run import Journal, Run, ServerStopping
from actionkit.servers._serving.harness import Harness
from actionkit.testing._fake_plans import Plan, Script

_LONGEST = 60
"""Characters of the action's name in the node's name; ROS allows 255 in all."""


def check_name(name: object) -> str:
    """Return the name of an action.

    Raises:
        TypeError: It is not a string.
        ValueError: ROS refuses it.
    """
    if not isinstance(name, str):
        raise TypeError(f"name={name!r} must be a string, such as 'pick'")
    if not name.isprintable():  # the middleware reads a name up to its first NUL only
        raise ValueError(f"name={name!r} has characters that are no text; remove them")
    try:
        validate_topic_name(name)
    except InvalidTopicNameException as error:
        reason = " ".join(str(error).split("\n")[0].split(": ", 1)[-1].split())
        raise ValueError(f"name={name!r} is not a valid ROS name: {reason}") from None
    return name


class Goals:
    """The goals that a fake server has received, and the plan of each."""

    def __init__(self, script: Script, on_error: Callable[[BaseException], None]) -> None:
        self.script = script
        self.on_error = on_error
        self.received: list[Any] = []
        self._entries: dict[str, Plan | Callable[[Any], Any]] = {}

    def enter(self, run: Run) -> Plan | Callable[[Any], Any]:
        """Record a request; return the goal's plan. A repeated request gets the same plan."""
        if run.goal_id not in self._entries:
            self._entries[run.goal_id] = self.script.take()
            self.received.append(run.goal)
        return self._entries[run.goal_id]


class Fake(Behaviour):
    """Follows the plan of each goal; errors of the user's functions are kept."""

    any_type = True

    def __init__(self, options: Mapping[str, Any], process: Process, goals: Goals) -> None:
        super().__init__(options, process)
        self._goals = goals
        self._lock = threading.Lock()
        self._running: set[Run] = set()
        """The goals that were accepted and have not ended."""

    def received(self, run: Run) -> None:
        run.notes = self._goals.enter(run)

    def takes_time_to_decide(self, run: Run) -> bool:
        # A user's function may take any time: other requests are answered meanwhile.
        return not isinstance(run.notes, Plan) or run.notes.asks_early

    def decide(self, run: Run) -> bool:
        try:
            if not isinstance(run.notes, Plan):
                run.notes = self._goals.script.asked(run.notes, run.goal)
            plan = run.notes = run.notes.settled(run.goal)
        except ServerStopping:
            raise
        except BaseException as error:  # noqa: BLE001  pytest.fail() raises no Exception
            self._goals.on_error(error)
            return run.refuse("a function of the test raised")
        return bool(plan.settings["accept"])

    def begin(self, run: Run) -> None:
        with self._lock:
            if run.notes.settings["preempts"]:
                run.earlier = frozenset(self._running)
            self._running.add(run)
        for other in run.earlier:
            other.preempt()
        run.begin()

    def takes_time_to_cancel(self) -> bool:
        with self._lock:
            return any(callable(run.notes.settings["cancel"]) for run in self._running)

    def may_cancel(self, run: Run) -> bool:
        try:
            answer = run.notes.value("cancel", run.goal)
        except BaseException as error:  # noqa: BLE001  pytest.fail() raises no Exception
            self._goals.on_error(error)
            answer = "refuse"
        run.heeds_cancel = answer == "accept"
        return bool(answer != "refuse")

    def execute_to_end(self, run: Run) -> object:
        try:
            return super().execute_to_end(run)
        except ServerStopping:
            raise
        except BaseException as error:  # noqa: BLE001  pytest.fail() raises no Exception
            self._goals.on_error(error)
            return run.abort(())
        finally:
            with self._lock:
                self._running.discard(run)
                others = list(self._running)
            for other in others:
                other.wake()  # it may wait for the end of this goal

    def execute(self, run: Run) -> object:
        plan: Plan = run.notes
        run.wait_until(lambda: self._has_its_place(run))
        for message in plan.feedback(run.goal):
            run.pause(0)
            run.feedback(message)
            run.pause(plan.settings["period"])
        run.pause(0)
        end = plan.settings["end"]
        if end == "never":
            run.wait_until(lambda: False)  # raises if the goal must stop
        result = plan.value("result", run.goal)
        run.pause(0)
        if end == "canceled":
            self._enter_canceling(run)
            run.content = result
            return run.canceled()
        return run.succeed(result) if end == "succeeded" else run.abort(result)

    def stopped(self, run: Run) -> object:
        if not (run.cancelled and run.heeds_cancel):
            return run.abort(())  # preempted: with an empty result, as Nav2's servers do
        # If the plan has another end, its result is not for a cancelled goal.
        meant = run.notes.settings["end"] in ("never", "canceled")
        run.content = run.notes.value("result", run.goal) if meant else ()
        return run.canceled()

    def _has_its_place(self, run: Run) -> bool:
        """Return whether the goals that it preempts have ended."""
        with self._lock:
            return not run.earlier & self._running

    @staticmethod
    def _enter_canceling(run: Run) -> None:
        """Enter CANCELING like after a client's request: ROS permits CANCELED only then."""
        try:
            run.handle._update_state(GoalEvent.CANCEL_GOAL)
        except RuntimeError:
            if not run.handle.is_cancel_requested:  # otherwise a client was quicker, which is fine
                raise


def make_harness(
    goals: Goals, action: Any, name: str, domain_id: int, number: int, journal: Journal
) -> Harness:
    """Return a fake server's ROS side, which answers nothing before it is started.

    `number` counts the fake servers of this process.
    """
    options = {**COMMON_OPTIONS, "steps": 0}
    short = re.sub(r"\W|__+", "_", name)[-_LONGEST:].strip("_")
    return Harness(
        lambda given, process: Fake(given, process, goals),
        options,
        action,
        name,
        node_name=f"fake_server_{short}_{os.getpid()}_{number}",
        journal=journal,
        life=Life(1, journal),
        foreign=True,
        domain_id=domain_id,
    )

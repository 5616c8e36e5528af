# rclpy has annotations here and there only.
# mypy: disable-error-code="no-untyped-call"
"""What a fake server does when goals come. Imports rclpy, so it is imported late."""

from __future__ import annotations

import os
import re
import threading
from collections.abc import Callable, Mapping
from typing import Any

from rclpy.action.server import GoalEvent
from rclpy.exceptions import InvalidTopicNameException
from rclpy.validate_topic_name import validate_topic_name

from actionkit.servers._behaviour import COMMON_OPTIONS, Behaviour, Process
from actionkit.servers._harness import Harness
from actionkit.servers._life import Life
from actionkit.servers._run import Journal, Run, ServerStopping
from actionkit.testing._fake_plans import Plan, Script

_LONGEST = 60
"""Characters of the action's name that the node's name repeats; ROS allows 255 in all."""


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
    """The goals that a fake server has received, and the plan of each.

    Attributes:
        received: The goals' messages, in the order of their requests.
    """

    def __init__(self, script: Script, on_error: Callable[[BaseException], None]) -> None:
        self.script = script
        self.on_error = on_error
        self.received: list[Any] = []
        self._entries: dict[str, Plan | Callable[[Any], Any]] = {}

    def enter(self, run: Run) -> Plan | Callable[[Any], Any]:
        """Note a request; return the goal's plan, the same where a request is sent again."""
        if run.goal_id not in self._entries:
            self._entries[run.goal_id] = self.script.take()
            self.received.append(run.goal)
        return self._entries[run.goal_id]


class Fake(Behaviour):
    """Does what the plan of each goal says; what a function of the user's raises is kept."""

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
        # A function of the user's may take as long as it likes: other requests are answered.
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
        run.refuses_cancel = plan.settings["cancel"] == "refuse"
        run.heeds_cancel = plan.settings["cancel"] == "accept"
        return bool(plan.settings["accept"])

    def begin(self, run: Run) -> None:
        with self._lock:
            if run.notes.settings["preempts"]:
                run.earlier = frozenset(self._running)
            self._running.add(run)
        for other in run.earlier:
            other.preempt()
        run.begin()

    def may_cancel(self, run: Run) -> bool:
        return not run.refuses_cancel

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
                other.wake()  # it may wait for this end

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
            run.wait_until(lambda: False)  # raises where it is to stop
        result = plan.value("result", run.goal)
        run.pause(0)
        if end == "canceled":
            self._enter_canceling(run)
            run.content = result
            return run.canceled()
        return run.succeed(result) if end == "succeeded" else run.abort(result)

    def stopped(self, run: Run) -> object:
        if not (run.cancelled and run.heeds_cancel):
            return run.abort(())  # preempted: Nav2's servers, too, send an empty result then
        # Where the plan's end is another, its result speaks of something that did not happen.
        meant = run.notes.settings["end"] in ("never", "canceled")
        run.content = run.notes.value("result", run.goal) if meant else ()
        return run.canceled()

    def _has_its_place(self, run: Run) -> bool:
        """Return whether the goals that it preempts have ended."""
        with self._lock:
            return not run.earlier & self._running

    @staticmethod
    def _enter_canceling(run: Run) -> None:
        """Do what a client's request to cancel does: ROS permits CANCELED only after it."""
        try:
            run.handle._update_state(GoalEvent.CANCEL_GOAL)
        except RuntimeError:
            if not run.handle.is_cancel_requested:  # a client was quicker: that is as good
                raise


def make_harness(
    goals: Goals, action: Any, name: str, domain_id: int | None, number: int, journal: Journal
) -> Harness:
    """Return a fake server's ROS side, which answers nothing before it is started.

    Args:
        goals: Its goals.
        action: The action's class.
        name: The action's name.
        domain_id: The ROS domain; `None` takes the environment's.
        number: Of this fake server, among those of this process.
        journal: Where events are written.
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

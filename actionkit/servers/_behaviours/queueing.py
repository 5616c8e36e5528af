"""Reference servers that consider their other goals before they accept or run one."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Mapping
from typing import Any, ClassVar

from actionkit.servers._behaviours.basic import Fibonacci
from actionkit.servers._behaviours.behaviour import Process
from actionkit.servers._run import Run


class Guarded(Fibonacci):
    """As fibonacci, for even orders up to `max_order`; with busy=1, for one goal at a time.

    The journal's event "rejected" has the `reason`: negative, odd, too large or busy. With
    busy=1, goals are rejected from the acceptance of another goal until its end.
    """

    options: ClassVar = {**Fibonacci.options, "max_order": 20, "busy": 0}

    def __init__(self, options: Mapping[str, Any], process: Process) -> None:
        super().__init__(options, process)
        self._lock = threading.Lock()
        self._last: Run | None = None

    def decide(self, run: Run) -> bool:
        if run.order < 0:
            return run.refuse("negative")
        if run.order % 2:
            return run.refuse("odd")
        if run.order > self.option["max_order"]:
            return run.refuse("too large")
        with self._lock:
            if self.option["busy"] and self._last is not None and not self._last.ended:
                return run.refuse("busy")
            self._last = run
        return True


class Queued(Fibonacci):
    """One goal at a time, in the order of their acceptance; each as by fibonacci.

    The other goals wait: they are accepted, but do not execute. If a waiting goal is cancelled, it
    ends at once as CANCELED, without executing.
    """

    any_type = True
    options: ClassVar = {**Fibonacci.options, "period": 0.1}

    def __init__(self, options: Mapping[str, Any], process: Process) -> None:
        super().__init__(options, process)
        self._lock = threading.Lock()
        self._current: Run | None = None
        self._waiting: deque[Run] = deque()

    def begin(self, run: Run) -> None:
        with self._lock:
            self.enters(run, [] if self._current is None else [self._current, *self._waiting])
            self._waiting.append(run)
        self._advance()

    def enters(self, run: Run, before: list[Run]) -> None:
        """Called when a goal was accepted; the goals in `before` have not ended."""

    def cancelled(self, run: Run) -> None:
        with self._lock:
            if run not in self._waiting:
                return
            self._waiting.remove(run)
        run.drop()

    def execute_to_end(self, run: Run) -> object:
        result = super().execute_to_end(run)
        with self._lock:
            self._current = None
        self._advance()
        return result

    def _advance(self) -> None:
        """If no goal executes, let the goal that has waited longest execute."""
        while True:
            with self._lock:
                if self._current is not None or not self._waiting:
                    return
                run = self._waiting.popleft()
                # A goal may be CANCELING though `cancelled` has not been called for it yet.
                dropped = run.handle.is_cancel_requested
                if not dropped:
                    self._current = run
            if dropped:
                run.drop()
            else:
                run.begin()


class Preemptive(Queued):
    """A new goal preempts the running one, which is aborted before the new one executes.

    Both work as with fibonacci; the older goal's result is the sequence that it had reached.
    ends=canceled: the older goal ends as CANCELED. rclpy permits this only after a request to
    cancel the goal, so another client in the server process sends one. Goals that come in a burst
    preempt each other in turn: each executes for a moment, because a goal can be aborted only then.
    """

    options: ClassVar = {**Queued.options, "ends": "aborted"}
    choices: ClassVar = {"ends": ("aborted", "canceled")}

    def __init__(self, options: Mapping[str, Any], process: Process) -> None:
        super().__init__(options, process)
        if options["ends"] == "canceled":
            process.enable_self_cancel()

    def enters(self, run: Run, before: list[Run]) -> None:
        for other in before:
            if not other.preempted:
                other.preempt()
                other.emit("preempted", by=run.goal_id)

    def execute(self, run: Run) -> object:
        run.content = [0, 1]
        run.pause(0)
        return super().execute(run)

    def stopped(self, run: Run) -> object:
        if not run.cancelled:
            if self.option["ends"] == "aborted":
                return run.abort()
            self.process.cancel_from_elsewhere(run.goal_id)
            run.wait_cancel()
        return run.canceled()

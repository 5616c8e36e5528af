"""One goal on its server, and the gate where goals can be made to wait. No rclpy here."""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol, TypeAlias

Content: TypeAlias = Sequence[int] | Mapping[str, object]
"""The contents of a message: its `sequence`, or its fields by path, as `{"goal_info.stamp.sec":
3}`. A message is possible, too: it is sent unchanged."""


class ServerStopping(BaseException):
    """Ends a goal's thread when the process must end.

    Not an `Exception`: for rclpy, that would be a failed goal; it would abort it and print a
    traceback.
    """


class GoalStopped(Exception):
    """The goal must stop: it is being cancelled, or another goal replaces it."""


class Journal(Protocol):
    """Takes events. While a thread holds the lock, no other thread writes."""

    lock: Any

    def emit(self, event: str, goal_id: str | None = None, **details: Any) -> None: ...


class Control:
    """Shared by all goals of a process: the end of the process, and the gate."""

    def __init__(self) -> None:
        self.stopping = False
        self._lock = threading.Lock()
        self._runs: set[Run] = set()
        self._waiting: deque[Run] = deque()
        self._tickets = 0.0  # how many more goals may pass; infinite while the gate is open

    def add(self, run: Run) -> None:
        with self._lock:
            self._runs.add(run)

    def discard(self, run: Run) -> None:
        with self._lock:
            self._runs.discard(run)

    def stop(self) -> None:
        """Wake every goal that waits; each then raises `ServerStopping`."""
        with self._lock:
            self.stopping = True
            runs = list(self._runs)
        for run in runs:
            run.wake()

    def release(self, n: int | None = None) -> None:
        """Let the first `n` waiting goals through the gate; `None` opens it."""
        with self._lock:
            self._tickets = math.inf if n is None else self._tickets + n
            while self._waiting and self._tickets:
                self._pass(self._waiting.popleft())

    def hold(self) -> None:
        """Close the gate."""
        with self._lock:
            self._tickets = 0

    def arrive(self, run: Run) -> None:
        """Let the goal through the gate, or put it at the end of the queue there."""
        with self._lock:
            if self._tickets:
                self._pass(run)
            else:
                self._waiting.append(run)

    def leave(self, run: Run) -> None:
        """Take the goal out of the queue, if it is still there."""
        with self._lock:
            if run in self._waiting:
                self._waiting.remove(run)

    def _pass(self, run: Run) -> None:
        self._tickets -= 1
        run.passed = True
        run.wake()


class Run:
    """One goal, from its request on. A cancel ends its waits at once, without polling."""

    def __init__(
        self,
        goal: Any,
        goal_id: str,
        *,
        server: int,
        number: int,
        order: int,
        journal: Journal,
        control: Control,
        make_message: Callable[[str, Content], Any],
    ) -> None:
        self.goal = goal
        self.order = order  # how many steps it asks for
        self.goal_id = goal_id
        self.handle: Any = None  # rclpy's ServerGoalHandle, once the goal is accepted
        self.server = server  # which of the action servers on the name
        self.number = number  # how many goals came before, also before restarts
        self.reason: str | None = None  # of its rejection
        self.content: Content = ()  # the contents of its result, unless its end has others
        self.notes: Any = None  # the behaviour's own
        self.earlier: frozenset[Run] = frozenset()  # the goals that it replaces
        self.steps = 0  # of its script that have begun
        self.heeds_cancel = True  # whether an accepted cancel stops the goal
        self.refuses_cancel = False
        self.cancelled = False
        self.preempted = False
        self.dropped = False
        self.ended = False  # terminal, or about to become so
        self.passed = False  # through the gate
        self.result_requested = False
        self._feedbacks = 0
        self._journal = journal
        self._control = control
        self._make_message = make_message
        self._wake = threading.Event()

    def emit(self, event: str, **details: Any) -> None:
        """Write a journal event about this goal."""
        if self.server:
            details["server"] = self.server
        self._journal.emit(event, self.goal_id, **details)

    def refuse(self, reason: str) -> bool:
        """Return `False`, for `decide`; the journal gets the reason."""
        self.reason = reason
        return False

    def begin(self) -> None:
        """Let the accepted goal execute."""
        try:
            self.handle.execute()
        except RuntimeError:
            # A cancel came between rclpy's check of the state and its change to EXECUTING.
            if not self.handle.is_cancel_requested:
                raise
            self.handle.execute()

    def drop(self) -> None:
        """End a goal that is being cancelled as CANCELED, without executing it."""
        self.dropped = True
        self.begin()

    # -- woken by others -------------------------------------------------------------------

    def wake(self) -> None:
        self._wake.set()

    def cancel(self) -> None:
        """Record that the goal has entered CANCELING."""
        self.cancelled = True
        self.wake()

    def preempt(self) -> None:
        """Record that another goal replaces this one."""
        self.preempted = True
        self.wake()

    def request_result(self) -> None:
        """Record that a client has asked for the goal's result."""
        self.result_requested = True
        self.wake()

    # -- waits: all raise ServerStopping when the process must end, all except two GoalStopped

    def pause(self, seconds: float) -> None:
        """Wait that long; with 0, only check whether the goal must stop."""
        self._wait(lambda: False, seconds)

    def wait_gate(self) -> None:
        """Wait until the gate lets the goal through."""
        self.passed = False
        self._control.arrive(self)
        try:
            self._wait(lambda: self.passed, None)
        finally:
            self._control.leave(self)

    def wait_result_request(self) -> None:
        """Wait until a client has asked for the result.

        If a client cancels right after that, before this thread wakes, the cancel counts.
        """
        self._wait(lambda: self.result_requested, None)

    def wait_until(self, condition: Callable[[], bool]) -> None:
        """Wait until a condition is true; the code that makes it true calls `wake`."""
        self._wait(condition, None)

    def wait_cancel(self) -> None:
        """Wait until the goal is being cancelled; never raises GoalStopped."""
        self._sleep(lambda: self.cancelled, None)

    def wait_forever(self) -> None:
        """Wait until the process ends; never raises GoalStopped."""
        self._sleep(lambda: False, None)

    def _wait(self, until: Callable[[], bool], seconds: float | None) -> None:
        self._sleep(lambda: self._is_to_stop or until(), seconds)
        if self._is_to_stop:
            raise GoalStopped

    @property
    def _is_to_stop(self) -> bool:
        return self.preempted or (self.cancelled and self.heeds_cancel)

    def _sleep(self, until: Callable[[], bool], seconds: float | None) -> None:
        deadline = None if seconds is None else time.monotonic() + seconds
        while True:
            # Cleared before the check: code that changes something later sets it again.
            self._wake.clear()
            if self._control.stopping:
                raise ServerStopping
            if until():
                return
            remaining = None if deadline is None else deadline - time.monotonic()
            if remaining is not None and remaining <= 0:
                return
            self._wake.wait(remaining)

    # -- what the client sees --------------------------------------------------------------

    def feedback(self, content: Content, *, journal: bool = True) -> None:
        """Publish feedback, and keep it as the result; `journal` says whether to write an event."""
        if self._control.stopping:
            raise ServerStopping
        self.content = content
        self._feedbacks += 1
        try:
            self.handle.publish_feedback(self._make_message("Feedback", content))
        except RuntimeError as error:  # RCLError, InvalidHandle: the server is ending
            self.emit("error", message=f"feedback: {error}")
        else:
            if journal:
                self.emit("feedback", n=self._feedbacks)

    def succeed(self, content: Content | None = None) -> Any:
        """End as SUCCEEDED; return the result message, which `execute` has to return.

        `content` is what the result says; `None` means `self.content`.
        """
        return self._end("succeeded", self.handle.succeed, content)

    def canceled(self) -> Any:
        """End as CANCELED, with `self.content` as the result."""
        return self._end("canceled", self.handle.canceled, None)

    def abort(self, content: Content | None = None) -> Any:
        """End as ABORTED; otherwise like `succeed`."""
        return self._end("aborted", self.handle.abort, content)

    def _end(self, event: str, transition: Callable[[], None], content: Content | None) -> Any:
        if self._control.stopping:
            raise ServerStopping
        # Under the lock, because a client may send a new goal at once after the published status:
        # in the journal, that goal must come after this one's end.
        with self._journal.lock:
            self.ended = True
            try:
                transition()
            except RuntimeError as error:
                self.emit("error", message=f"{event}: {error}")
            else:
                self.emit(event)
        return self._make_message("Result", self.content if content is None else content)

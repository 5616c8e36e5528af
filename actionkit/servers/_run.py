"""One goal on its server, and the gate that goals may be made to wait at. No rclpy here."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol, TypeAlias

#: What a message says: its `sequence`, or its fields by path, as ``{"goal_info.stamp.sec": 3}``.
Content: TypeAlias = Sequence[int] | Mapping[str, object]


class ServerStopping(BaseException):
    """Unwinds a goal's thread when the process is to end.

    Not an ``Exception``: rclpy would take that for a failed goal, abort it and print a traceback.
    """


class Journal(Protocol):
    """Where events go. Holding the lock keeps others from writing in between."""

    lock: Any

    def emit(self, event: str, goal_id: str | None = None, **details: Any) -> None: ...


class Messages(Protocol):
    """Makes the messages of the action in use."""

    def result(self, content: Content) -> Any: ...

    def feedback(self, content: Content) -> Any: ...


class Control:
    """What all goals of a process share: the end of the process, and the gate."""

    def __init__(self) -> None:
        self.stopping = False
        self._lock = threading.Lock()
        self._runs: set[Run] = set()
        self._waiting: deque[Run] = deque()
        self._open = False
        self._tickets = 0

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
        """Let `n` goals through the gate, the first to wait first; ``None``: open it."""
        with self._lock:
            if n is None:
                self._open = True
            else:
                self._tickets += n
            while self._waiting and (self._open or self._tickets):
                self._pass(self._waiting.popleft())

    def hold(self) -> None:
        """Close the gate."""
        with self._lock:
            self._open = False
            self._tickets = 0

    def arrive(self, run: Run) -> None:
        """The goal stands at the gate."""
        with self._lock:
            if self._open or self._tickets:
                self._pass(run)
            else:
                self._waiting.append(run)

    def leave(self, run: Run) -> None:
        """The goal waits no more, let through or not."""
        with self._lock:
            if run in self._waiting:
                self._waiting.remove(run)

    def _pass(self, run: Run) -> None:
        if not self._open:
            self._tickets -= 1
        run.passed = True
        run.wake()


class Run:
    """One goal, from its request on. Its waits end at once on a cancel, without polling."""

    def __init__(
        self,
        goal: Any,
        goal_id: str,
        *,
        server: int,
        number: int,
        journal: Journal,
        control: Control,
        make: Messages,
    ) -> None:
        self.goal = goal
        self.goal_id = goal_id
        self.handle: Any = None  # rclpy's ServerGoalHandle, once it is accepted
        self.server = server
        #: How many goals the server was asked for before, restarts included.
        self.number = number
        self.reason: str | None = None  # of its rejection
        #: The behaviour's own, about this goal.
        self.notes: Any = None
        self.cancelled = False
        self.preempted = False
        self.dropped = False
        #: It is terminal, or about to become so.
        self.ended = False
        self.passed = False
        self.result_requested = False
        self.feedbacks = 0
        self._journal = journal
        self._control = control
        self._make = make
        self._wake = threading.Event()

    @property
    def order(self) -> int:
        """The goal's `order`, 0 in an action that has none."""
        return int(getattr(self.goal, "order", 0))

    def emit(self, event: str, **details: Any) -> None:
        """Write a journal event about this goal."""
        if self.server:
            details["server"] = self.server
        self._journal.emit(event, self.goal_id, **details)

    def refuse(self, reason: str) -> bool:
        """For `decide`: False, and the journal will say why."""
        self.reason = reason
        return False

    def begin(self) -> None:
        """Let the accepted goal execute."""
        try:
            self.handle.execute()
        except RuntimeError:
            # A cancel came between rclpy's look at the state and its step to EXECUTING.
            if not self.handle.is_cancel_requested:
                raise
            self.handle.execute()

    def drop(self) -> None:
        """End as CANCELED, without executing, a goal that is being cancelled."""
        self.dropped = True
        self.begin()

    # -- woken by others -------------------------------------------------------------------

    def wake(self) -> None:
        self._wake.set()

    def cancel(self) -> None:
        """The goal has entered the state CANCELING."""
        self.cancelled = True
        self.wake()

    def preempt(self) -> None:
        """Another goal is to take this one's place."""
        self.preempted = True
        self.wake()

    def request_result(self) -> None:
        """A client asked for the goal's result."""
        self.result_requested = True
        self.wake()

    # -- waits; each raises ServerStopping when the process is to end ------------------------

    def pause(self, seconds: float) -> bool:
        """Wait so long; True, and at once, when the goal is to stop."""
        return self._wait(lambda: self._to_stop, seconds)

    def wait_cancel(self) -> None:
        """Wait until the goal is being cancelled."""
        self._wait(lambda: self.cancelled, None)

    def rest(self, seconds: float) -> None:
        """Wait so long, cancelled or not."""
        self._wait(lambda: False, seconds)

    def wait_gate(self, *, heed_cancel: bool = True) -> bool:
        """Wait until let through the gate; True when it is to stop first."""
        self.passed = False
        self._control.arrive(self)
        try:
            self._wait(lambda: self.passed or (heed_cancel and self._to_stop), None)
        finally:
            self._control.leave(self)
        return not self.passed

    def wait_result_request(self) -> bool:
        """Wait until a client has asked for the result; True where it is being cancelled.

        A client may do one right after the other, and both before this thread wakes.
        """
        self._wait(lambda: self.result_requested or self.cancelled, None)
        return self.cancelled

    def wait_forever(self) -> None:
        """Wait until the process ends."""
        self._wait(lambda: False, None)

    @property
    def _to_stop(self) -> bool:
        return self.cancelled or self.preempted

    def _wait(self, until: Callable[[], bool], seconds: float | None) -> bool:
        deadline = None if seconds is None else time.monotonic() + seconds
        while True:
            # Cleared before looking: whoever changes something after that sets it again.
            self._wake.clear()
            if self._control.stopping:
                raise ServerStopping
            if until():
                return True
            remaining = None if deadline is None else deadline - time.monotonic()
            if remaining is not None and remaining <= 0:
                return False
            self._wake.wait(remaining)

    # -- what the client sees --------------------------------------------------------------

    def feedback(self, content: Content, *, journal: bool = True) -> None:
        """Publish feedback, and write a journal event about it, or not."""
        if self._control.stopping:
            raise ServerStopping
        self.feedbacks += 1
        try:
            self.handle.publish_feedback(self._make.feedback(content))
        except RuntimeError as error:  # RCLError, InvalidHandle: the server is being taken down
            self.emit("error", message=f"feedback: {error}")
        else:
            if journal:
                self.emit("feedback", n=self.feedbacks)

    def succeed(self, content: Content = ()) -> Any:
        """End as SUCCEEDED; returns the result message, which `execute` has to return."""
        return self._end("succeeded", self.handle.succeed, content)

    def canceled(self, content: Content = ()) -> Any:
        """End as CANCELED."""
        return self._end("canceled", self.handle.canceled, content)

    def abort(self, content: Content = ()) -> Any:
        """End as ABORTED."""
        return self._end("aborted", self.handle.abort, content)

    def _end(self, event: str, transition: Callable[[], None], content: Content) -> Any:
        if self._control.stopping:
            raise ServerStopping
        # Under the lock, because a client may answer the published status with a new goal at
        # once: in the journal, that goal must not come before this one's end.
        with self._journal.lock:
            self.ended = True
            try:
                transition()
            except RuntimeError as error:
                self.emit("error", message=f"{event}: {error}")
            else:
                self.emit(event)
        return self._make.result(content)

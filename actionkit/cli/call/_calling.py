"""Makes one call from the command line, reports it, and cancels its goal if it ends early.

Or it follows the goal of another program, and lets it run.
"""

from __future__ import annotations

import contextlib
import queue
import sys
import threading
import time
from collections.abc import Callable
from typing import Any

from actionkit import Client, GoalFuture
from actionkit._messages.progress import Progress
from actionkit._model.errors import ActionKitError
from actionkit._model.values import CancelReport, GoalEvent, GoalState, Outcome
from actionkit.cli._shared.exits import Exit, exit_of
from actionkit.cli._shared.say import say
from actionkit.cli._shared.signals import discard_output, handled, watch_output
from actionkit.cli._shared.wording import in_options
from actionkit.cli.call._reports import Now, Report, became

_TICK = 0.1
"""Seconds between two looks at the goal's timeline, and between two frames of the display: short
enough to look immediate."""
_ROOM = 256
"""Feedback messages that may wait to be written: some seconds of feedback, and little memory."""
_SLOW = 0.5
"""Seconds for which a message waits for such a place; then it is not shown, only counted."""
_SECOND_PRESS = 2.0
"""Seconds for a second Ctrl-C, which cancels the goal of another program."""
_MARGIN = 0.5
"""Seconds more than the client's own limit for a cancel, so that its report comes first."""


class Calling:
    """Makes one call and follows it. In the main thread, because signals arrive there."""

    def __init__(
        self,
        client: Client[Any],
        report: Report,
        *,
        echo: bool,
        progress: Progress | None,
        detaches: bool = False,
    ) -> None:
        """Take what the call needs. `run` closes the client at its end.

        `echo` means to write each feedback message. `progress` reads from feedback how much is
        done. With `detaches`, the first signal lets the goal run, and the second one cancels it.
        """
        self._detaches = detaches
        self._detach_at: float | None = None
        self._client = client
        self._report = report
        self._echo = echo
        self._progress = progress
        # Not Queue: a signal handler may call put() during a get().
        self._inbox: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()
        self._room = threading.BoundedSemaphore(_ROOM)
        self._feedbacks = 0
        self._not_shown = 0
        self._share: float | None = None
        self._seen: set[GoalEvent] = set()
        self._code: Exit | None = None
        self._give_up_at: float | None = None
        self._future: GoalFuture[Any, Any] | None = None

    def run(self, begin: Callable[[Callable[[Any], None]], GoalFuture[Any, Any]]) -> Exit:
        """Make the call, with `begin`, which gets a feedback callback; return its exit code."""
        times = 2 if self._detaches else 1
        try:
            with handled(self._interrupt_soon, self._farewell, times=times), self._client:
                watch_output(lambda: self._interrupt_soon(Exit.OUTPUT_CLOSED))
                return self._run(begin)
        finally:
            with contextlib.suppress(OSError):
                self._report.close()

    def _run(self, begin: Callable[[Callable[[Any], None]], GoalFuture[Any, Any]]) -> Exit:
        self._tell(self._report.begin)
        self._empty_inbox()
        if self._code is not None:  # a signal came, or nobody gets the output
            self._tell(lambda: say("Nothing was sent.", err=True))
            return self._code
        self._began = time.monotonic()
        self._future = future = begin(self._on_feedback)
        future.add_done_callback(lambda _: self._inbox.put(_nothing))
        while not future.done():
            self._turn()
            if self._give_up_at is not None and time.monotonic() >= self._give_up_at:
                # The cancel was refused, so the goal runs: closing ends the wait, not the goal.
                self._client.close()
            if self._detach_at is not None and time.monotonic() >= self._detach_at:
                self._client.close()
        self._empty_inbox()
        self._catch_up(time.monotonic(), ended=True)
        if self._not_shown:
            self._tell(lambda: self._report.not_shown(self._not_shown))
        outcome = future.outcome(0)
        if isinstance(outcome.error, ActionKitError):
            outcome.error.message = in_options(outcome.error.message)
        code = exit_of(outcome) if self._code is None else self._code
        self._tell(lambda: self._report.finished(outcome, code))
        self._last_words(outcome)
        return self._code or code

    def _empty_inbox(self) -> None:
        with contextlib.suppress(queue.Empty):
            while True:
                self._inbox.get_nowait()()

    def _turn(self) -> None:
        with contextlib.suppress(queue.Empty):
            self._inbox.get(timeout=_TICK)()
        if self._inbox.empty():
            self._catch_up(time.monotonic())
        assert self._future is not None
        elapsed = time.monotonic() - self._began
        now = Now(self._future.state, elapsed, self._feedbacks, self._share)
        self._tell(lambda: self._report.now(now))

    def _catch_up(self, until: float, *, ended: bool = False) -> None:
        """Report the new events of the timeline, up to the monotonic time `until`.

        `ended` means that all feedback was reported: the goal's end is reported after it.
        """
        assert self._future is not None
        events = [e for e in self._future.timeline if e.state is not GoalState.FEEDBACK]
        if not ended and events and events[-1].state.is_terminal:
            events.pop()
        for event in events:
            if event.monotonic <= until and event not in self._seen:
                self._seen.add(event)
                if event.cancel_refused and self._code is not None:
                    self._give_up_at = event.monotonic  # the client closes, and asks once more
                self._tell(lambda e=event: self._report.event(e))  # type: ignore[misc]

    def _on_feedback(self, message: Any) -> None:
        self._feedbacks += 1
        if self._progress is not None:
            self._share = self._progress.share(message)
        if not self._echo:
            return
        at = time.monotonic()
        if self._room.acquire(timeout=_SLOW):
            number = self._feedbacks
            self._inbox.put(lambda: self._show(message, number, at))
        else:
            self._not_shown += 1

    def _show(self, message: Any, number: int, at: float) -> None:
        self._room.release()
        self._catch_up(at)
        self._tell(lambda: self._report.feedback(message, number, at))

    # --- the end from outside --------------------------------------------------------------

    def _interrupt_soon(self, code: Exit) -> None:
        self._inbox.put(lambda: self._interrupt(code))

    def _interrupt(self, code: Exit) -> None:
        if self._future is None:  # so it is not sent
            self._code = self._code or code
            return
        if self._future.done():
            return
        if self._detaches and self._code is None:
            self._code = code
            pressed = code is Exit.INTERRUPTED
            self._detach_at = time.monotonic() + (_SECOND_PRESS if pressed else 0.0)
            self._tell(lambda: self._report.detaching(code))
            return
        if self._code is not None and self._detach_at is None:
            return
        if self._detach_at is not None and code is not Exit.INTERRUPTED:
            self._detach_at = time.monotonic()  # only Ctrl-C cancels it
            return
        self._code, self._detach_at = code, None
        self._give_up_at = time.monotonic() + self._client.timeouts.cancel + _MARGIN
        self._future.cancel()
        self._catch_up(time.monotonic())
        self._tell(lambda: self._report.interrupted(code))

    def _tell(self, words: Callable[[], None]) -> None:
        try:
            words()
        except OSError:  # nobody reads the output: cancel the goal, and write nothing
            discard_output()
            self._interrupt(Exit.OUTPUT_CLOSED)

    def _last_words(self, outcome: Outcome[Any]) -> None:
        """If nobody reads the output, write to standard error that the goal may still run."""
        safe = (None, CancelReport.CONFIRMED, CancelReport.NOT_NEEDED)
        detached = self._detach_at is not None
        if self._code is Exit.OUTPUT_CLOSED and not detached and outcome.cancel not in safe:
            with contextlib.suppress(OSError):
                print(became(outcome), file=sys.stderr, flush=True)

    def _farewell(self) -> str:
        if self._future is None or self._future.state is GoalState.SENDING:
            return "Left at once. Nothing was sent."
        if self._detach_at is not None:
            return f"Left at once. Goal {self._future.goal_id} runs on."
        if self._future.done():
            return "Left at once. The goal had ended."
        return (
            f"Left at once. Goal {self._future.goal_id} MAY STILL BE RUNNING: its cancellation"
            " was asked for, and not confirmed so far."
        )


def _nothing() -> None:
    """Do nothing; as an item of the inbox, it wakes the main thread."""

"""Hands events to one observer: in order, on a thread that its client has for observers, and
never on the thread that completes the goals (R8).

Nothing is left out, but where very much waits, and then feedback first. A client that closes, and
the interpreter at its exit, wait a limited time for what is queued.
"""

from __future__ import annotations

import logging
import time

from actionkit._threads.diagnostics import is_interrupt, log_here, log_later, write_to_stderr
from actionkit._threads.in_hand import Label
from actionkit._threads.pool import Job, Pool
from actionkit._threads.serial_queue import SerialQueue
from actionkit._threads.waiting import Flag

MOST_FEEDBACK = 1_000
"""With so many events waiting, feedback is left out: ten seconds of feedback at 100 Hz."""
MOST = 100_000
"""With so many waiting, everything is: some 100 MB, which an observer that hangs may hold."""
_WARNING_PERIOD = 60.0
"""Seconds between warnings of a log handler that raises, which may do so with every record."""


class ObserverQueue(SerialQueue):
    """The events for one observer of one client. Only the communication thread puts them in."""

    def __init__(
        self, label: Label, pool: Pool, action_name: str, *, ends_on_error: bool = True
    ) -> None:
        """Make an empty one.

        Args:
            label: Which observer it is, for the warnings.
            pool: Where the jobs run.
            action_name: The client's, for the warnings.
            ends_on_error: Whether nothing more is handed over after an error, as with observers;
                the log gets what comes afterwards all the same.
        """
        super().__init__(pool, label, MOST)
        self.name = f"{label} of action {action_name!r}"
        self.ends_on_error = ends_on_error
        self._errors = 0
        self._quiet_until = 0.0
        self._lost = 0
        self._warned_of_loss = False

    def put_event(self, job: Job, *, feedback: bool = False) -> None:
        """Queue a job that hands an event over. Never blocks."""
        if len(self._jobs) >= (MOST_FEEDBACK if feedback else MOST):
            self._lost += 1
        else:
            self.put(job)

    def flush(self, until: float, *, here: bool = False) -> bool:
        """Wait until what is queued has been handed over. Takes no lock where `here` is not set.

        Args:
            until: Monotonic time at which not to wait any longer.
            here: Hand it over on this thread if none has begun to. From Python 3.12 on no thread
                can be started at the interpreter's exit.

        Returns:
            Whether nothing is queued any more.
        """
        while self._scheduled and (self._thread is not None or not here):
            rested = Flag()
            self._finishes.append(rested.set)
            # It may have come to rest just before.
            if self._scheduled and not rested.wait(until - time.monotonic()):
                return False
        if self._scheduled:
            self._run_here(until)
        return not self._scheduled

    def _schedule(self) -> None:
        super()._schedule()
        _busy.add(self)

    def _rest(self) -> None:
        super()._rest()
        if not self._scheduled:
            _busy.discard(self)

    def _run(self, job: Job) -> None:
        try:
            job()
        except BaseException as error:
            if is_interrupt(error):
                raise  # a human who does not want to wait for the exit
            self._on_error()
        if self._lost and not self._warned_of_loss:
            self._warned_of_loss = True
            log_here(
                logging.WARNING,
                "%s is too slow: events are left out, feedback from %d waiting events on",
                self.name,
                MOST_FEEDBACK,
            )

    def _on_error(self) -> None:
        """Log the error of the observer, which is being handled, and close where that is due."""
        if self.ends_on_error:
            self.close()
            log_here(
                logging.WARNING, "%s raised, and is told nothing more", self.name, exc_info=True
            )
            return
        self._errors += 1
        if time.monotonic() < self._quiet_until:
            return
        self._quiet_until = time.monotonic() + _WARNING_PERIOD
        log_here(
            logging.WARNING,
            "%s raised (%d times so far), and was given what came after all the same",
            self.name,
            self._errors,
            exc_info=True,
        )


_busy: set[ObserverQueue] = set()
"""The queues with something in them, for the interpreter's exit."""


def flush_all(until: float) -> None:
    """At the interpreter's exit: wait for what is queued anywhere, and warn of what is left."""
    for queue in list(_busy):
        if queue.flush(until, here=True):
            continue
        text = "at exit, %s had not been told everything"
        if queue.ends_on_error:
            log_later(logging.WARNING, text, queue.name)
        else:  # it is the log that takes nothing
            write_to_stderr(text % queue.name)


def after_fork() -> None:
    """In a forked child: leave the events of the parent's observers to the parent."""
    _busy.clear()

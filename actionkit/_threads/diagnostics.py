"""Writes to the logger `actionkit`, even if a handler there blocks or raises an error.

The handlers are the user's. So a thread that must not be held up, above all the communication
thread (R8), gives its records to a thread that only writes records.
"""

from __future__ import annotations

import contextlib
import logging
import math
import os
import sys
import threading
import time
import traceback
from types import TracebackType
from typing import NamedTuple

from actionkit._threads.serial_queue import SerialQueue
from actionkit._threads.waiting import Flag

_logger = logging.getLogger("actionkit")
MOST = 1_000
"""Records that may wait for a handler that blocks; more are left out and counted. These are
warnings and errors: more than a few at a time are repetitions."""

_ExcInfo = tuple[type[BaseException], BaseException, TracebackType | None]


class _Entry(NamedTuple):
    """The data of a record. The record is made later, as the record factory may be the user's."""

    wall: float
    thread: int
    thread_name: str
    place: tuple[str, int, str]
    level: int
    text: str
    args: tuple[object, ...]
    exc_info: _ExcInfo | None
    stack: str | None


class _Writer(SerialQueue[_Entry]):
    """Writes records in order, on a thread that exists only while there are records."""

    _lost = 0

    def add(self, entry: _Entry) -> None:
        """Queue a record. Never blocks."""
        if len(self._items) >= MOST:
            self._lost += 1
        else:
            self.put(entry)

    def _begin(self) -> None:
        try:
            threading.Thread(target=self._write_all, name="actionkit-log", daemon=True).start()
        except RuntimeError:
            # No more threads; from Python 3.12 on, none can start at the interpreter's exit. The
            # record waits for `flush`, or for the next record that finds a thread.
            self._in_use.release()

    def flush(self, until: float) -> bool:
        """Wait until everything is written, or until that monotonic time; return whether it is.

        If no other thread is writing, this thread writes.
        """
        rested = Flag()
        self._finishes.append(rested.set)
        if self._in_use.acquire(blocking=False):
            self._write_all(until)
        return rested.wait(until - time.monotonic())

    def _write_all(self, until: float = math.inf) -> None:
        while (entry := self._take()) is not None:
            try:
                _write(entry)
            except KeyboardInterrupt:  # a human does not want to wait at the exit
                self._in_use.release()
                raise
            if self._items and time.monotonic() >= until:
                self._in_use.release()
                return

    def _rest(self) -> None:
        if self._lost:
            lost, self._lost = self._lost, 0
            text = "%d messages of ActionKit's were left out: a log handler was blocked"
            _write(_entry(logging.WARNING, text, (lost,), None, None))
        super()._rest()


_writer = _Writer()


def log_later(
    level: int,
    text: str,
    *args: object,
    exc_info: bool | BaseException = False,
    stack: str | None = None,
) -> None:
    """Log to `actionkit` soon, on another thread. Never blocks or raises.

    No `str()` of the values in `args` may run code of the user's that might block. `exc_info`
    is an exception, to add its traceback, or whether to add that of the exception that is
    being handled. `stack` is a stack to show under the message.
    """
    if is_enabled_for(_logger, level):
        error = exc_info if isinstance(exc_info, BaseException) else None
        if exc_info is True:
            error = sys.exc_info()[1]
        if sys.is_finalizing():  # for objects that the interpreter drops at its exit
            _write_at_the_end(text % args, error)
            return
        kept = None if error is None else (type(error), error, error.__traceback__)
        _writer.add(_entry(level, text, args, kept, stack))


def is_enabled_for(logger: logging.Logger, level: int) -> bool:
    """Like `logger.isEnabledFor`, for the communication thread.

    `isEnabledFor` sometimes takes a lock, which a thread holds while it sets up logging. If a
    signal handler closed a client in that thread, the two threads would wait for each other.
    """
    return (
        not logger.disabled
        and level > logger.manager.disable
        and level >= logger.getEffectiveLevel()
    )


def log_own_error() -> None:
    """Log soon the exception that is being handled: a mistake in ActionKit itself."""
    log_later(logging.ERROR, "an error in ActionKit itself; please report it", exc_info=True)


def log_here(level: int, text: str, *args: object, exc_info: bool = False) -> None:
    """Log to `actionkit` on this thread, which a handler may block.

    It raises nothing except KeyboardInterrupt on the main thread.
    """
    try:
        _logger.log(level, text, *args, exc_info=exc_info, stacklevel=2)
    except BaseException as error:  # noqa: BLE001  a handler of the user's may raise anything
        _handler_raised(error)


def flush(until: float) -> bool:
    """Wait until all records are written, or until that monotonic time; return whether they are."""
    return _writer.flush(until)


def after_fork() -> None:
    """In a forked child: leave the records of the parent to the parent."""
    global _writer  # noqa: PLW0603  a thread that does not exist here may have held its lock
    _writer = _Writer()


def dated(record: logging.LogRecord, wall: float) -> logging.LogRecord:
    """Set a record's time to the time of its event, and not of the writing."""
    record.relativeCreated += (wall - record.created) * 1000
    record.created = wall
    record.msecs = float(int(wall % 1 * 1000))
    return record


def write_to_stderr(text: str) -> None:
    """Write a line to standard error, if there is one, for text that must not go to the log."""
    if sys.stderr is not None:
        with contextlib.suppress(OSError, ValueError):  # it is closed
            sys.stderr.write(text.rstrip("\n") + "\n")


def is_interrupt(error: BaseException) -> bool:
    """Whether the error is Ctrl-C: only the main thread gets it, and it must not be swallowed."""
    on_main = threading.current_thread() is threading.main_thread()
    return on_main and isinstance(error, KeyboardInterrupt)


def _entry(
    level: int, text: str, args: tuple[object, ...], exc_info: _ExcInfo | None, stack: str | None
) -> _Entry:
    thread, frame = threading.current_thread(), sys._getframe(2)
    place = (frame.f_code.co_filename, frame.f_lineno, frame.f_code.co_name)
    ident = threading.get_ident()
    return _Entry(time.time(), ident, thread.name, place, level, text, args, exc_info, stack)


def _write(entry: _Entry) -> None:
    try:
        file, line, function = entry.place
        record = _logger.makeRecord(
            _logger.name,
            entry.level,
            file,
            line,
            entry.text,
            entry.args,
            entry.exc_info,
            function,
            sinfo=entry.stack,
        )
        record.thread, record.threadName = entry.thread, entry.thread_name
        _logger.handle(dated(record, entry.wall))
    except BaseException as error:  # noqa: BLE001  a handler of the user's may raise anything
        _handler_raised(error)


def _write_at_the_end(text: str, error: BaseException | None) -> None:
    """Write to standard error without any lock, while the interpreter is exiting.

    At that time no other thread runs, and a new thread never starts (before Python 3.12, its
    `start()` waits for that for ever). If another thread has held a lock, such as that of a log
    handler, the lock is never released.
    """
    lines = [text + "\n", *([] if error is None else traceback.format_exception(error))]
    with contextlib.suppress(AttributeError, OSError, ValueError):  # there is none, or it is closed
        os.write(sys.stderr.fileno(), "".join(lines).encode(errors="backslashreplace"))


def _handler_raised(error: BaseException) -> None:
    """Write the error to where `logging` itself writes the errors of its handlers."""
    if is_interrupt(error):
        raise error
    if logging.raiseExceptions:
        write_to_stderr(
            "--- a handler or filter of the logger 'actionkit' raised ---\n"
            + "".join(traceback.format_exception(error))
        )

"""Cancels the goals of a process that a signal tells to end, before it ends (C2.6), and wakes event
loops that await goals.

Python runs all signal handlers in the main thread, between two bytecodes of that thread. If it
stays inside C code, as in rclpy's `spin` while nothing happens, no handler runs until it returns.
So one of our threads learns about signals, too, through Python's wakeup file descriptor, and
cancels the goals if the main thread does not begin to.
"""

from __future__ import annotations

import os
import select
import signal
import threading
import warnings
from collections import Counter
from collections.abc import Callable
from types import FrameType, TracebackType

from actionkit._calls.on_signal.signal_handlers import (
    Handler,
    end_process,
    is_of_a_user,
    rclpy_handles,
    set_handler,
)
from actionkit._threads.waiting import Flag

_DEFAULT = (signal.SIGTERM, signal.SIGHUP)
_MAIN_HEARS = 0.2
"""Seconds for the main thread to begin, before our thread does its work. If it runs Python code, it
needs microseconds, and a human does not notice this time."""

_NOT_ENDING = {
    *(signal.SIGKILL, signal.SIGSTOP),  # cannot be handled
    *(signal.SIGCHLD, signal.SIGCONT, signal.SIGURG, signal.SIGWINCH),  # only inform
    *(signal.SIGTSTP, signal.SIGTTIN, signal.SIGTTOU),  # stop a process
    *(signal.SIGSEGV, signal.SIGBUS, signal.SIGFPE, signal.SIGILL),  # repeat at once
}

_before: dict[int, Handler] = {}
"""What each signal did before we handled it."""
_users: Counter[int] = Counter()
"""How many `cancel_on_signals` handle each signal."""
_at_work: dict[str, _Work] = {}
"""The work that cancels the goals now; `setdefault` lets only one begin."""
_watcher: _Watcher | None = None
_woken: dict[object, Callable[[], None]] = {}
"""What wakes the event loops that are to hear signals, one entry for each wait."""


def _nothing(hurry: Callable[[], bool]) -> None:
    """Cancel no goals: no client has been made in this process yet."""


cancel_goals: Callable[[Callable[[], bool]], None] = _nothing
"""Cancels all goals and waits for that. `_calls.ending.exit` sets it; importing that module here
would import rclpy."""


class _Work:
    """The cancelling because of one signal."""

    def __init__(self) -> None:
        self.thread = threading.get_ident()
        """The main thread's id, or the watcher's."""
        self.hurry = Flag()
        self.over = Flag()


def is_ending() -> bool:
    """Whether a signal makes us cancel goals now: then no other goal begins. From any thread."""
    return bool(_at_work)


class cancel_on_signals:
    """Cancel every goal of this process when a signal tells it to end.

        cancel_on_signals()

    On the signal, all goals in flight are cancelled on their servers. The process waits at most
    `timeouts.cancel` seconds for the confirmations: the longest time of all clients, or longer
    while servers go on confirming many goals. A warning names goals that may still run. Then the
    signal does what it did before: a Python handler is called, rclpy's own handler does its part,
    or the process ends. A second signal, or Ctrl-C, ends the wait.

    As a context manager, it restores the earlier handlers at the end of the block.

    A later `signal.signal()` for the same signal replaces it, and so does `add_signal_handler()` of
    an event loop. You may call `cancel_on_signals` before or after `rclpy.init()`.
    """

    def __init__(self, *signals: int) -> None:
        """Handle signals.

        Args:
            signals: The default is SIGTERM and SIGHUP, but not one that is ignored, such as SIGHUP
                under `nohup`. A signal that you give is handled even if it was ignored, such as
                SIGINT in a script's background. Then it ends the process after the goals.

        Raises:
            RuntimeError: Not called in the main thread.
            TypeError: A value is not a signal number.
            ValueError: A value is not a signal that ends a process and can be handled.
        """
        if threading.current_thread() is not threading.main_thread():
            raise RuntimeError(
                "cancel_on_signals() must be called in the main thread, because Python handles"
                " signals only there: call it at the start of the program"
            )
        for number in signals:
            _check(number)
        default = [each for each in _DEFAULT if signal.getsignal(each) is not signal.SIG_IGN]
        self._signals = [int(each) for each in dict.fromkeys(signals or default)]
        for number in self._signals:
            _users[number] += 1
            if signal.getsignal(number) is not _on_signal:
                _before[number] = signal.getsignal(number)
                set_handler(number, _on_signal)
        _watch()

    def __enter__(self) -> cancel_on_signals:
        return self

    def __exit__(
        self,
        exc_type: type[BaseException] | None,
        exc: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        for number in self._signals:
            _users[number] -= 1
            # A handler that was set later stays.
            if not _users[number] and signal.getsignal(number) is _on_signal:
                set_handler(number, _before[number])
        self._signals = []
        if not any(_users.values()):
            _stop_watching()


class waking:
    """Wake an event loop when a signal comes, as long as a goal is awaited there.

    In Jupyter, the handler of Ctrl-C (the stop button) only leaves a note for the loop, which finds
    it when it next wakes up. That may be at the end of the goal.
    """

    def __init__(self, wake: Callable[[], None]) -> None:
        """`wake` wakes the loop; it is called on another thread."""
        self._wake = wake

    def __enter__(self) -> None:
        # Python hears of signals, and sets the file descriptor, in the main thread only.
        if threading.current_thread() is threading.main_thread() and is_of_a_user(
            signal.getsignal(signal.SIGINT)
        ):
            _woken[self] = self._wake
            _watch()

    def __exit__(self, *exc: object) -> None:
        if _woken.pop(self, None) and not _woken and not any(_users.values()):
            _stop_watching()


def _check(number: object) -> None:
    if isinstance(number, bool) or not isinstance(number, int):
        raise TypeError(
            f"cancel_on_signals: {number!r} is no signal: give signals one by one, such as"
            " signal.SIGTERM"
        )
    if number not in signal.valid_signals() or number in _NOT_ENDING:
        raise ValueError(
            f"cancel_on_signals: {number!r} is no signal that tells a process to end and can be"
            " handled"
        )


def _former(number: int) -> Handler:
    """Return what a signal did before; if it was ignored, its default."""
    handler = _before[number]
    if handler is not signal.SIG_IGN:
        return handler
    return signal.default_int_handler if number == signal.SIGINT else signal.SIG_DFL


# --- on the signal -----------------------------------------------------------------------------


def _on_signal(number: int, frame: FrameType | None) -> None:
    """Cancel the goals, then let the signal do what it did before. In the main thread."""
    another = _watcher is not None and _watcher.main_hears()
    mine = _Work()
    while (work := _at_work.setdefault("", mine)) is not mine:
        if work.thread == mine.thread:
            work.hurry.set()  # a second signal; the first handler continues and does the rest
            return
        if another:
            work.hurry.set()
        work.over.wait()  # the watcher was first
    try:
        if _watcher is None or not _watcher.has_done(number):
            cancel_goals(work.hurry.is_set)
    finally:
        try:
            _pass_on(number, frame)
        finally:
            _leave(mine)


def _leave(work: _Work) -> None:
    if _at_work.get("") is work:
        del _at_work[""]
    work.over.set()


def _pass_on(number: int, frame: FrameType | None) -> None:
    before = _former(number)
    if callable(before):
        _at_work.clear()  # the handler may begin goals, and must end them itself
        before(number, frame)
    elif not rclpy_handles(number):
        end_process(number)


class _Watcher:
    """Cancels the goals if the main thread does not notice the signal."""

    def __init__(self) -> None:
        self._reads, self.writes = os.pipe()
        for end in (self._reads, self.writes):
            os.set_blocking(end, False)
        self._heard = Flag()
        self._done: set[int] = set()
        threading.Thread(target=self._main, name="actionkit-signals", daemon=True).start()

    def main_hears(self) -> bool:
        """Record that the main thread saw the signal; return True if it was first."""
        another = bool(self._read())
        self._heard.set()
        return another

    def has_done(self, number: int) -> bool:
        """Return whether the watcher cancelled the goals for a signal; True once for each time."""
        done = number in self._done
        self._done.discard(number)
        return done

    def _read(self) -> list[int]:
        """Return the signals that have arrived and that matter here."""
        try:
            numbers = os.read(self._reads, 64)
        except BlockingIOError:
            return []
        return [n for n in numbers if signal.getsignal(n) is _on_signal or n == signal.SIGINT]

    def _main(self) -> None:
        poll = select.poll()
        poll.register(self._reads, select.POLLIN)
        while True:
            self._heard = Flag()
            poll.poll()
            for wake in list(_woken.values()):
                wake()
            numbers = self._read()
            if numbers and not self._heard.wait(_MAIN_HEARS):
                for number in numbers[:1]:
                    if signal.getsignal(number) is _on_signal:
                        self._take_over(number)

    def _take_over(self, number: int) -> None:
        mine = _Work()
        if _at_work.setdefault("", mine) is not mine:
            return  # the main thread is doing it
        try:
            if self._heard.is_set():
                return  # it is about to begin
            cancel_goals(lambda: mine.hurry.is_set() or bool(self._read()))
            if not callable(_former(number)) and not rclpy_handles(number):
                end_process(number)
            self._done.add(number)
        finally:
            _leave(mine)


def _watch() -> None:
    """Let the watcher read signals, unless an event loop does: then the main thread runs."""
    global _watcher  # noqa: PLW0603  one for each process
    if _watcher is None:
        _watcher = _Watcher()
        os.register_at_fork(after_in_child=_after_fork)
        # While trio runs, it replaces our file descriptor with its own. That is right: its own
        # wakes the main thread. But trio warns that it has found ours.
        trios = "It looks like Trio's signal handling code"
        warnings.filterwarnings("ignore", trios, RuntimeWarning, "trio")
    earlier = signal.set_wakeup_fd(_watcher.writes, warn_on_full_buffer=False)
    if earlier not in (-1, _watcher.writes):
        signal.set_wakeup_fd(earlier)


def _stop_watching() -> None:
    """Stop the watcher from reading signals."""
    if _watcher is not None:
        earlier = signal.set_wakeup_fd(-1)
        if earlier != _watcher.writes:
            signal.set_wakeup_fd(earlier)


def _after_fork() -> None:
    """Leave the watcher to the parent; otherwise it would see the child's signals."""
    global _watcher  # noqa: PLW0603
    _stop_watching()
    _watcher = None
    _woken.clear()
    _at_work.clear()

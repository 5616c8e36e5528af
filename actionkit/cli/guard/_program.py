"""The program of a guard, and the processes that it has started.

A process with a parent that has ended becomes a child of the guard. So the guard sees all of them,
also those that have left the group and the session of the program.
"""

from __future__ import annotations

import ctypes
import math
import os
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from actionkit._model.printable import on_one_line
from actionkit.cli._shared.exits import Exit
from actionkit.cli._shared.problems import Problem

_ENDING = {signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT}
_PASSED_ON = {*_ENDING, signal.SIGUSR1, signal.SIGUSR2}
_LOOK = 0.5
"""Seconds between two looks whether processes have ended, if nobody is told of that."""
_GRACE = 4.0
"""Half the seconds from SIGTERM to SIGKILL for what the program has started. One that was told
already, as by Ctrl-C, gets SIGTERM only after this. `Timeouts.cancel` is 2."""
_PR_SET_PDEATHSIG = 1
_PR_SET_CHILD_SUBREAPER = 36


class Program:
    """A program, and all processes that it has started."""

    def __init__(self, writers: Callable[[], set[int]], say: Callable[[str], object]) -> None:
        """`writers` returns the processes that write goals in the ledger."""
        self._writers = writers
        self._say = say
        self.told = False
        """Whether a signal has told it to end; one that it may survive, as Ctrl-C, does not."""
        self._crashed = self._over = False
        self._heard: set[int] = set()
        """The processes that got the latest signal that ends."""

    def run(self, words: tuple[str, ...], environment: dict[str, str]) -> int:
        """Run it in the same terminal; return its exit code, or less than 0 after a signal.

        Raises:
            Problem: It cannot be started.
        """
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)  # if it is ignored, the exit code is lost
        prctl, guard = ctypes.CDLL(None).prctl, os.getpid()
        prctl(_PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)
        with _blocked() as before:

            def prepare() -> None:
                prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)  # if the guard is killed, it ends, too
                signal.pthread_sigmask(signal.SIG_SETMASK, before)
                if os.getppid() != guard:
                    os._exit(Exit.FAILED)

            if self.told:
                return Exit.TERMINATED  # a signal came in the last moment
            try:
                process = subprocess.Popen(words, env=environment, preexec_fn=prepare)  # noqa: PLW1509
            except FileNotFoundError as error:
                raise Problem(Exit.NOT_FOUND, f"the command {words[0]!r} is not there") from error
            except OSError as error:
                text = f"the command {words[0]!r} cannot be run ({error.strerror})"
                raise Problem(Exit.NOT_EXECUTABLE, text) from error
            while (code := _ended().get(process.pid)) is None:
                self._hear({process.pid})
            while self._hear(set(), 0):
                pass  # these were for the program
        process.returncode = code
        self._crashed, self._over = code < 0, True
        return code

    def await_writers(self, unless: Callable[[], bool]) -> bool:
        """Wait for the end of the processes that write goals.

        If the program was told to end, or has crashed, they are told to end. Else this returns True
        as soon as `unless` does.
        """
        return self._await(self._writing, unless)

    def end_others(self) -> bool:
        """If the program was told to end, or has crashed, end all of this session.

        Some may soon write goals. Not before all goals are cancelled: that needs the servers among
        them. Return whether there were any.
        """
        if not (self.told or self._crashed):
            return False
        found = bool(self._in_session())
        self._await(self._in_session, lambda: False)
        return found

    def _await(self, look: Callable[[], set[int]], unless: Callable[[], bool]) -> bool:
        began = math.inf
        done: set[tuple[int, int]] = set()
        with _blocked():
            while pids := look():
                if self.told or self._crashed:
                    began = min(began, time.monotonic())
                elif unless():
                    return True
                waited = time.monotonic() - began
                if waited > 3 * _GRACE:
                    self._say(f"{', '.join(map(_name, pids))} cannot be ended")
                    return False
                for pid in pids:
                    number = signal.SIGTERM if waited < 2 * _GRACE else signal.SIGKILL
                    is_warned = waited < 0 or (waited < _GRACE and pid in self._heard)
                    step = 0 if is_warned else number
                    if (pid, step) not in done:
                        done.add((pid, step))
                        what = f"sending {number.name} to" if step else "waiting for"
                        self._say(f"{what} {_name(pid)}, which the program has started")
                        if step:
                            self._send(pid, step)
                self._hear(pids)
                _ended()
        return False

    def _writing(self) -> set[int]:
        return {pid for pid in self._writers() if _is_ours(pid)}

    def _in_session(self) -> set[int]:
        found = set()
        for path in Path("/proc").glob("[0-9]*"):
            with suppress(ProcessLookupError):
                if os.getsid(pid := int(path.name)) == os.getsid(0) and _is_ours(pid):
                    found.add(pid)
        return found

    def _hear(self, pids: set[int], seconds: float = _LOOK) -> bool:
        """Wait for a signal, pass it on to processes, and return whether there was any."""
        told = signal.sigtimedwait(_heard_by_us(), seconds)
        if told is None or told.si_signo == signal.SIGCHLD:
            return told is not None
        self._heard = set() if told.si_signo in _ENDING else self._heard
        if told.si_signo == signal.SIGINT and not self._over:
            with suppress(OSError):  # `ros2 run` leaves it to its child, which a terminal tells
                pids = pids | self._writing()
        elif told.si_signo in _ENDING:
            self.told = True
        for pid in pids:
            with suppress(ProcessLookupError):
                # Of a terminal that was closed, the kernel tells only the leader of the session.
                leads = told.si_signo == signal.SIGHUP and os.getsid(0) == os.getpid()
                if told.si_code <= 0 or leads:
                    self._send(pid, told.si_signo)
                elif os.getpgid(pid) == os.getpgrp():
                    self._heard.add(pid)  # a terminal has sent it to the whole group
        return True

    def _send(self, pid: int, number: int) -> None:
        if number in _ENDING:
            self._heard.add(pid)
        with suppress(ProcessLookupError, PermissionError):  # such as for `sudo`
            os.kill(pid, number)


@contextmanager
def _blocked() -> Iterator[set[int]]:
    """Block the signals; give those that were blocked before.

    They are waited for: so it is known who has sent them.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, _heard_by_us())
    try:
        yield set(before)
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _heard_by_us() -> set[int]:
    """Return the signals to wait for; one that is ignored, as by `nohup`, stays so."""
    heard = {each for each in _PASSED_ON if signal.getsignal(each) is not signal.SIG_IGN}
    return {*heard, signal.SIGCHLD}


def _ended() -> dict[int, int]:
    """Return the children that have ended, with their exit codes: less than 0 after a signal."""
    found: dict[int, int] = {}
    with suppress(ChildProcessError):
        while (ended := os.waitpid(-1, os.WNOHANG))[0]:
            found[ended[0]] = os.waitstatus_to_exitcode(ended[1])
    return found


def _is_ours(pid: int) -> bool:
    """Whether a process descends from this one."""
    at = pid
    while True:
        try:
            text = Path(f"/proc/{at}/stat").read_text()
        except OSError:
            if at == pid or not _has_ended(at):
                return False  # /proc may hide the processes of other users
            at = pid  # an ancestor has just ended: the process has another one now
            continue
        at = int(text[text.rindex(")") :].split()[2])
        if at in (0, os.getpid()):
            return at != 0


def _has_ended(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except OSError as error:
        return isinstance(error, ProcessLookupError)
    return False


def _name(pid: int) -> str:
    """Name a process for a human."""
    words = b"?"
    with suppress(OSError):
        words = Path(f"/proc/{pid}/cmdline").read_bytes().strip(b"\0").replace(b"\0", b" ")
    return f"process {pid} ({on_one_line(words.decode(errors='replace'))[:60]})"

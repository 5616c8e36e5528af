"""`actionkit guard`: run a program, and cancel the goals that it leaves running.

It runs with one thread and without rclpy, so that it alone decides what a signal does. The
cancelling is a process of its own.
"""

from __future__ import annotations

import ctypes
import importlib.util
import os
import resource
import signal
import subprocess
from contextlib import suppress

import click

from actionkit._model.own_module import command_for
from actionkit.cli._shared.exits import Exit
from actionkit.cli._shared.options import HELP, SECONDS, debug_option
from actionkit.cli._shared.problems import Problem, import_ros
from actionkit.cli._shared.say import say
from actionkit.cli._shared.signals import handled
from actionkit.cli.guard._leftovers import open_ledger

_EPILOG = """\b
Examples:
  actionkit guard -- python mission.py
  actionkit guard --ledger /var/lib/robot/goals.db -- python mission.py

The program needs no change: each Client writes its goals down in a file before it sends them. When
the program has ended in any way, also by SIGKILL, the goals that may still run are cancelled and
named, and then the guard ends as the program did. If the guard is killed, too, the next guard
cancels them before it starts its program; `actionkit leftovers` does so as well.

Guard each program that calls actions, not one that starts other programs."""
_LABEL = "actionkit guard: "
_EARLIER = "an earlier program has left goals, which are cancelled first"
_NOW = "the program has left goals, which are cancelled now"
_BUSY = "cancelling the goals that the program has left. Again, and it ends at once"
_LEFT = "goals MAY STILL BE RUNNING. `actionkit leftovers` shows and cancels them"
_PASSED_ON = {
    *(signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT),
    *(signal.SIGUSR1, signal.SIGUSR2),
}
_LOOK = 0.5
"""Seconds between two looks whether the program has ended, if nobody is told of that."""
_PR_SET_PDEATHSIG = 1


@click.command("guard", context_settings={**HELP, "allow_interspersed_args": False}, epilog=_EPILOG)
@click.option(
    "--ledger",
    "path",
    metavar="PATH",
    type=click.Path(dir_okay=False),
    help="The file for the goals. [default: that in ACTIONKIT_LEDGER, else one of this user]",
)
@click.option(
    "--timeout",
    type=SECONDS,
    default=10.0,
    show_default=True,
    help="How long cancelling may take.",
)
@click.argument("words", metavar="-- COMMAND...", nargs=-1, required=True, type=click.UNPROCESSED)
@debug_option
def command(path: str | None, timeout: float, words: tuple[str, ...]) -> int:
    """Run COMMAND, and cancel the goals that it leaves running, however it ends."""
    from actionkit._internal_api import unfinished_goals

    ledger = open_ledger(path)
    if importlib.util.find_spec("rclpy") is None:
        import_ros()  # says what to do; without it no goal could be cancelled
    cancels = ["leftovers", str(ledger.path), "--cancel", "--timeout", str(timeout)]
    if unfinished_goals(ledger):
        say(_LABEL + _EARLIER, err=True)
        _cancel(cancels)
    # Until the end of this, a signal that is not for the program alone must not end the guard.
    with handled(lambda _: say(_LABEL + _BUSY, err=True), lambda: _LABEL + _LEFT):
        code = _run(words, {**os.environ, "ACTIONKIT_LEDGER": str(ledger.path)})
        try:
            if unfinished_goals(ledger):
                say(_LABEL + _NOW, err=True)
                if _cancel(cancels) != Exit.OK:
                    say(_LABEL + _LEFT, err=True)
        except OSError as error:  # the exit code is the program's all the same
            say(f"{_LABEL}{error}\n{_LABEL}{_LEFT}", err=True)
    if code < 0:
        _end_by(-code)
        return 128 - code  # process 1 of a container does not end by a signal
    return code


def _cancel(words: list[str]) -> int:
    """Cancel what is left over, and tell of it on standard error; return the exit code."""
    # In a session of its own, a terminal's Ctrl-C does not end it. If the guard ends, it goes on.
    return subprocess.run(
        command_for("actionkit", *words), stdout=2, check=False, start_new_session=True
    ).returncode


def _run(words: tuple[str, ...], environment: dict[str, str]) -> int:
    """Run a command in the same terminal; return its exit code, or less than 0 after a signal.

    Raises:
        Problem: It cannot be started.
    """
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)  # if it is ignored, the exit code is lost
    # Blocked and then waited for: so it is known who has sent a signal.
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {*_PASSED_ON, signal.SIGCHLD})
    prctl, guard = ctypes.CDLL(None).prctl, os.getpid()

    def prepare() -> None:
        prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)  # if the guard is killed, the program ends, too
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        if os.getppid() != guard:
            os._exit(Exit.FAILED)

    try:
        process = subprocess.Popen(words, env=environment, preexec_fn=prepare)  # noqa: PLW1509
    except FileNotFoundError as error:
        raise Problem(Exit.NOT_FOUND, f"the command {words[0]!r} is not there") from error
    except OSError as error:
        raise Problem(
            Exit.NOT_EXECUTABLE, f"the command {words[0]!r} cannot be run ({error.strerror})"
        ) from error
    else:
        while process.poll() is None:
            told = signal.sigtimedwait({*_PASSED_ON, signal.SIGCHLD}, _LOOK)
            # A terminal has sent it to the program, too; a process has not.
            if told is not None and told.si_signo != signal.SIGCHLD and told.si_code <= 0:
                with suppress(PermissionError):  # such as for `sudo`
                    process.send_signal(told.si_signo)
        while signal.sigtimedwait(_PASSED_ON, 0) is not None:
            pass  # these were for the program
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
    return process.returncode


def _end_by(number: int) -> None:
    """End by the signal that has ended the program, as systemd and shells can tell it."""
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))  # the program has written its own core dump
    if number != signal.SIGKILL:
        signal.signal(number, signal.SIG_DFL)
    os.kill(os.getpid(), number)

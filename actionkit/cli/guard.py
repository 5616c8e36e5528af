"""`actionkit guard`: run a program, and cancel the goals that it leaves running."""

from __future__ import annotations

import ctypes
import os
import resource
import signal
import subprocess

import click

from actionkit.cli._exits import Exit
from actionkit.cli._leftovers import cancel, open_ledger, tell
from actionkit.cli._options import HELP, SECONDS, debug_option
from actionkit.cli._problems import Problem
from actionkit.cli._say import say
from actionkit.cli._signals import handled

_EPILOG = """\b
Examples:
  actionkit guard -- python mission.py
  actionkit guard --ledger /var/lib/robot/goals.db -- ros2 run robot mission

The program needs no change: each Client writes its goals down in a file before it sends them. When
the program has ended in any way, also by SIGKILL, the goals that may still run are cancelled and
named, and then the guard ends as the program did. If the guard is killed, too, the next guard
cancels them before it starts its program; `actionkit leftovers` does so as well.

Guard each program that calls actions, not one that starts other programs."""
_LABEL = "actionkit guard: "
_PASSED_ON = {
    *(signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT),
    *(signal.SIGUSR1, signal.SIGUSR2),
}
_BUSY = "cancelling the goals that the program has left. Again, and it ends at once."
_LEFT = "goals MAY STILL BE RUNNING. `actionkit leftovers` shows and cancels them."
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
    ledger = open_ledger(path)
    for goal, report in cancel(ledger, timeout).items():
        tell(goal, report, f"{_LABEL}left by an earlier program: ")
    code = _run(words, {**os.environ, "ACTIONKIT_LEDGER": str(ledger.path)})
    with handled(lambda _: say(_LABEL + _BUSY, err=True), lambda: _LABEL + _LEFT):
        for goal, report in cancel(ledger, timeout).items():
            tell(goal, report, f"{_LABEL}left by the program: ")
    if code < 0:
        _end_by(-code)
    return code


def _run(words: tuple[str, ...], environment: dict[str, str]) -> int:
    """Run a command in the same terminal; return its exit code, or less than 0 after a signal.

    Raises:
        Problem: It cannot be started.
    """
    # Blocked and then waited for: so it is known who has sent a signal.
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {*_PASSED_ON, signal.SIGCHLD})
    prctl = ctypes.CDLL(None).prctl

    def prepare() -> None:
        prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)  # if the guard is killed, the program ends, too
        signal.pthread_sigmask(signal.SIG_SETMASK, before)

    try:
        # Threads of the middleware may be there; `prepare` needs nothing that they could hold.
        process = subprocess.Popen(words, env=environment, preexec_fn=prepare)  # noqa: PLW1509
        while process.poll() is None:
            told = signal.sigwaitinfo({*_PASSED_ON, signal.SIGCHLD})
            # A terminal has sent it to the program, too; a process has not.
            if told.si_signo != signal.SIGCHLD and told.si_code <= 0:
                process.send_signal(told.si_signo)
        while signal.sigtimedwait(_PASSED_ON, 0) is not None:
            pass  # these were for the program
    except FileNotFoundError as error:
        raise Problem(Exit.NOT_FOUND, f"there is no command {words[0]!r}") from error
    except OSError as error:
        raise Problem(
            Exit.NOT_EXECUTABLE, f"the command {words[0]!r} cannot be run ({error.strerror})"
        ) from error
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
    return process.returncode


def _end_by(number: int) -> None:
    """End by the signal that has ended the program, as systemd and shells can tell it."""
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))  # the program has written its own core dump
    if number != signal.SIGKILL:
        signal.signal(number, signal.SIG_DFL)
    os.kill(os.getpid(), number)

"""`actionkit guard`: run a program, and cancel the goals that it leaves running.

It runs with one thread and without rclpy, so that it alone decides what a signal does. The
cancelling is a process of its own.
"""

from __future__ import annotations

import importlib.util
import os
import resource
import signal
import subprocess
from contextlib import suppress
from typing import TYPE_CHECKING

import click

from actionkit._model.environment.own_module import command_for
from actionkit.cli._shared.exits import Exit
from actionkit.cli._shared.options import HELP, SECONDS, debug_option
from actionkit.cli._shared.problems import import_ros
from actionkit.cli._shared.say import say
from actionkit.cli._shared.signals import handled
from actionkit.cli.guard._leftovers import open_ledger
from actionkit.cli.guard._program import Program

if TYPE_CHECKING:
    from actionkit import Ledger

_EPILOG = """\b
Examples:
  actionkit guard -- python mission.py
  actionkit guard --ledger /var/lib/robot/goals.db -- python mission.py

The program needs no change: each Client writes its goals down in a file before it sends them. When
the program has ended in any way, also by SIGKILL, the goals that may still run are cancelled and
named, and then the guard ends as the program did. If the guard is killed, too, the next guard
cancels them before it starts its program; `actionkit leftovers` does so as well.

If it starts others that call actions, as `ros2 run` does, the guard waits for them, too. After a
signal, or a crash, it tells them to end."""
_LABEL = "actionkit guard: "
_EARLIER = "an earlier program has left goals, which are cancelled first"
_NOW = "the program has left goals, which are cancelled now"
_BUSY = "cancelling the goals that the program has left. Again, and it ends at once"
_LEFT = "goals MAY STILL BE RUNNING. `actionkit leftovers` shows and cancels them"
_UNKNOWN = (
    "it is not known which goals the program has left ({}). They MAY STILL BE RUNNING: `actionkit"
    " stop` cancels all goals in sight"
)


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
    from actionkit._internal_api import unfinished_goals, writers

    ledger = open_ledger(path)
    if importlib.util.find_spec("rclpy") is None:
        import_ros()  # says what to do; without it no goal could be cancelled
    cancels = ["leftovers", str(ledger.path), "--cancel", "--timeout", str(timeout)]
    if unfinished_goals(ledger):
        _say(_EARLIER)
        _cancel(cancels)
    file = os.open(ledger.path, os.O_RDONLY)  # while it is open, no other one looks the same
    failed = False

    def checked() -> Ledger:
        if not os.path.samestat(os.fstat(file), ledger.path.stat()):
            raise FileNotFoundError(f"another file is in the place of {ledger.path}")
        return ledger

    def is_left() -> bool:
        return unfinished_goals(checked())

    def cancel() -> None:
        nonlocal failed
        if is_left():
            _say(_NOW)
            failed = _cancel(cancels) != Exit.OK
            if failed:
                _say(_LEFT)

    def hear(_: Exit) -> None:
        program.told = True
        _say(_BUSY)

    program = Program(lambda: writers(checked()), _say)
    # Until the end of this, a signal that is not for the program alone must not end the guard.
    with handled(hear, lambda: _LABEL + _LEFT):
        code = program.run(words, {**os.environ, "ACTIONKIT_LEDGER": str(ledger.path)})
        try:
            try:
                while program.await_writers(lambda: not failed and is_left()):
                    cancel()
                cancel()
            finally:
                ended_others = program.end_others()
            if ended_others or not failed:
                cancel()
        except OSError as error:
            _say(_UNKNOWN.format(error.__cause__ or error))
            code = code or Exit.FAILED
    if code < 0:
        _end_by(-code)
        return 128 - code  # process 1 of a container does not end by a signal
    return code


def _say(text: str) -> None:
    with suppress(OSError):  # the terminal may be closed: it cancels all the same
        say(_LABEL + text, err=True)


def _cancel(words: list[str]) -> int:
    """Cancel what is left over, and tell of it on standard error; return the exit code."""
    # In a session of its own, a terminal's Ctrl-C does not end it. If the guard ends, it goes on.
    return subprocess.run(
        command_for("actionkit", *words), stdout=2, check=False, start_new_session=True
    ).returncode


def _end_by(number: int) -> None:
    """End by the signal that has ended the program, as systemd and shells can tell it."""
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))  # the program has written its own core dump
    if number != signal.SIGKILL:
        signal.signal(number, signal.SIG_DFL)
    os.kill(os.getpid(), number)

"""Runs in the server's own process: arguments, signals, journal (stdout), commands (stdin)."""

from __future__ import annotations

import argparse
import json
import os
import signal
import stat
import sys
import threading
import time
import uuid
from collections.abc import Callable, Sequence
from typing import IO, TYPE_CHECKING, Any, NoReturn

from actionkit._messages.by_name import action_name, interface_class
from actionkit.servers._behaviours.registry import behaviour_named, is_foreign, names
from actionkit.servers._events import SYNCED
from actionkit.servers._life import END_SIGNALS, INSTANCE_VARIABLE, RESTART_SIGNAL, Life

if TYPE_CHECKING:
    from actionkit.servers._serving.harness import Harness

_STOP_TIMEOUT = 3.0
"""Seconds for a clean end; normally much less. Then the process is ended."""
_EVERY_GOAL = str(uuid.UUID(int=0))
"""The id in a request to cancel all goals."""


class StdoutJournal:
    """Writes events: JSON lines for a program, readable ones for a person."""

    def __init__(self, descriptor: int, level: str, human: bool) -> None:
        self.lock = threading.RLock()
        self._descriptor = descriptor
        always = {"ready", "error", "crashing", "restarting", SYNCED}
        self._only = always if level == "none" else None
        self._without = {"feedback"} if level == "goals" else set()
        self._human = human
        self._began = time.monotonic()
        self._known = {None, _EVERY_GOAL}
        """The ids of goals that came, for people. A client asks whether a server answers by a
        cancel request for an id that does not exist, and such questions are not shown."""

    def emit(self, event: str, goal_id: str | None = None, **details: Any) -> None:
        if event in self._without or (self._only is not None and event not in self._only):
            return
        with self.lock:
            now = time.monotonic()
            if self._human:
                if event == "cancel_requested" and goal_id not in self._known:
                    return
                self._known.add(goal_id)
                extra = " ".join(f"{key}={value}" for key, value in details.items())
                short = (goal_id or "")[:8]
                line = f"{now - self._began:9.3f}  {event:<16} {short:<8}  {extra}".rstrip()
            else:
                line = json.dumps({"event": event, "goal_id": goal_id, "monotonic": now, **details})
            data = line.encode() + b"\n"
            try:
                while data:  # unbuffered, so that a crash loses nothing
                    data = data[os.write(self._descriptor, data) :]
            except OSError:
                pass  # nobody reads any more; when stdin is closed, we end


def main(
    arguments: Sequence[str] | None = None, refuse: Callable[[str], NoReturn] | None = None
) -> None:
    """Run a server until SIGINT, SIGTERM or, if a program started it, the end of stdin.

    Does not return: the process ends here, with exit code 0, or 2 for wrong usage. `None` takes the
    arguments from `sys.argv`. `refuse` gets the text about wrong arguments; by default it is
    printed with the usage of this program, and the process ends.
    """
    # Before any thread is started, because threads inherit it: only sigwait takes signals.
    signal.pthread_sigmask(signal.SIG_BLOCK, {*END_SIGNALS, RESTART_SIGNAL})
    parser = _parser()
    refuse = refuse or parser.error
    given = parser.parse_args(arguments)
    if given.list:
        for name, description in names().items():
            print(f"{name:<16} {description}")
        sys.exit(0)
    if given.name is None:
        refuse("NAME is missing; see --list")
    try:
        behaviour = behaviour_named(given.name)
        type_given = action_name(given.type or behaviour.action_type)
        foreign = is_foreign(given.name, type_given)
        options = behaviour.parse(dict(_pair(text) for text in given.option), foreign=foreign)
        action = interface_class(type_given, "action")
    except ValueError as error:
        refuse(str(error))

    # A pipe from a program has commands, and its end ends the server. A terminal does not.
    piped = not given.human and stat.S_ISFIFO(os.fstat(0).st_mode)
    human = given.human or os.isatty(0)
    # Only the journal may write to stdout, even if a library prints something.
    sys.stdout.flush()
    stdout = os.dup(1)
    os.dup2(2, 1)
    journal = StdoutJournal(stdout, str(options["journal"]), human)

    from actionkit.servers._serving.harness import Harness  # needs rclpy, which is heavy

    try:
        harness = Harness(
            behaviour,
            options,
            action,
            given.action,
            # The same after a restart, as for a real server, but different for each server.
            node_name=f"reference_server_{os.environ.get(INSTANCE_VARIABLE, os.getpid())}",
            journal=journal,
            life=Life(stdout, journal),
            foreign=foreign,
        )
    except ValueError as error:
        refuse(str(error))
    harness.start()
    journal.emit("ready", server=given.name, action=given.action, pid=os.getpid())
    if piped:
        threading.Thread(
            target=_obey, args=(sys.stdin.buffer, harness, journal), name="commands", daemon=True
        ).start()
    received = signal.sigwait({*END_SIGNALS, RESTART_SIGNAL})
    _end(harness, restart=received == RESTART_SIGNAL)


def _end(harness: Harness, *, restart: bool) -> NoReturn:
    # The middleware may hang during its shutdown.
    guard = threading.Timer(_STOP_TIMEOUT, os._exit, (1,))
    guard.daemon = True
    guard.start()
    harness.stop()
    sys.stderr.flush()
    # If both a restart and an end were requested, the process ends.
    if restart and not signal.sigpending() & END_SIGNALS:
        harness.life.start_anew("clean")
    # Not sys.exit: it would wait for the threads of goals, which may be blocked.
    os._exit(0)


def _obey(commands: IO[bytes], harness: Harness, journal: StdoutJournal) -> None:
    for line in commands:
        try:
            command: dict[str, Any] = json.loads(line)
            name = command.pop("command")
            if name == "release":
                harness.control.release(command.get("n"))
                journal.emit("released", n=command.get("n"))
            elif name == "hold":
                harness.control.hold()
                journal.emit("held")
            elif name == "sync":
                journal.emit(SYNCED, n=command["n"])
            else:
                journal.emit("error", message=f"unknown command {name!r}")
        except (ValueError, KeyError, AttributeError) as error:
            journal.emit("error", message=f"not a command: {line!r}: {error!r}")
    # The parent closed the pipe, or died.
    os.kill(os.getpid(), signal.SIGTERM)


def _pair(text: str) -> tuple[str, str]:
    key, separator, value = text.partition("=")
    if not separator:
        raise ValueError(f"--option {text!r} is not of the form key=value")
    return key, value


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m actionkit.servers", description="Run a reference action server."
    )
    parser.add_argument("name", metavar="NAME", nargs="?", help="which server; see --list")
    parser.add_argument("--action", default="fibonacci", help="action name (default: fibonacci)")
    parser.add_argument(
        "--type",
        metavar="TYPE",
        help="action type, such as my_robot/action/Pick, for servers"
        " that serve any; without it their own",
    )
    parser.add_argument(
        "--option", action="append", default=[], metavar="KEY=VALUE", help="may be repeated"
    )
    parser.add_argument("--list", action="store_true", help="list the servers and leave")
    parser.add_argument(
        "--human", action="store_true", help="readable output; run on when stdin ends"
    )
    return parser

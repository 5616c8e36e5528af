"""Starts, controls and ends a server process. No rclpy here."""

from __future__ import annotations

import contextlib
import itertools
import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
from functools import partial
from typing import IO, ClassVar

from typing_extensions import Self

from actionkit._messages.by_name import action_name as name_of
from actionkit.servers._behaviours.behaviour import Option, format_option
from actionkit.servers._behaviours.registry import behaviour_named, is_foreign
from actionkit.servers._events import EventNotSeenError, Journal, ServerEvent
from actionkit.servers._life import GOALS_VARIABLE, INSTANCE_VARIABLE
from actionkit.servers._quiet import await_quiet

_instances = itertools.count(1)
_START_TIMEOUT = 20.0
"""Seconds; a start takes one, but many more if dozens start on a busy machine."""
_STOP_TIMEOUT = 5.0
"""Seconds until a process is killed; it ends by itself after `_child._STOP_TIMEOUT`."""
_STDERR_SHOWN = 20_000
"""Bytes: enough for a few tracebacks, but short enough for a test's error text."""


class Server:
    """A reference server in its own process. `start` makes it. It is a context manager.

    Every method may be called from any thread.

    Attributes:
        name: The name of the reference server, such as `"fibonacci"`.
        action_name: The action that it serves.
    """

    _program: ClassVar[tuple[str, ...]] = ("-m", "actionkit.servers")
    """Python's arguments that run a server; our own tests have it run one in C++."""

    def __init__(
        self,
        name: str,
        action_name: str,
        type_name: str,
        domain_id: int | None,
        options: dict[str, Option],
    ) -> None:
        self.name = name
        self.action_name = action_name
        self._type_name = type_name
        self._domain_id = domain_id
        self._instance = f"{os.getpid()}_{next(_instances)}"
        self._options = options
        self._journal = Journal()
        self._last_stderr = ""
        self._stdin_lock = threading.Lock()
        self._process: subprocess.Popen[bytes]
        self._reader: threading.Thread
        self._stderr: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115 - closed by stop()
        try:
            self._launch()
        except BaseException:  # no file is left open
            self._stderr.close()
            raise

    # -- what it saw -----------------------------------------------------------------------

    @property
    def events(self) -> list[ServerEvent]:
        """Return all events, over restarts, in order."""
        return list(self._journal.events)

    def wait_for(
        self, event_name: str, *, goal_id: str | None = None, count: int = 1, timeout: float = 10.0
    ) -> list[ServerEvent]:
        """Block until the journal shows an event; earlier events count, too.

        Args:
            event_name: For instance `"accepted"` or `"cancel_requested"`.
            goal_id: Only events of the goal with this id count.
            count: How many such events.
            timeout: Seconds to wait.

        Returns:
            All such events until now, `count` or more.

        Raises:
            AssertionError: (also a `TimeoutError`) They were not seen in time, or the process
                ended without them; the message has the journal.
        """
        return self._journal.wait_for(event_name, goal_id=goal_id, count=count, timeout=timeout)

    def sync(self, timeout: float = 10.0) -> None:
        """Block until everything that the process has written to its journal can be read here.

        The journal comes through a pipe, so it may lag behind the server's answers. `"accepted"`
        and `"executing"` are written only after the answer to a goal: use `wait_for` for them.

        Raises:
            TimeoutError: The process did not answer in `timeout` seconds; it may be paused.
        """
        self._journal.sync(partial(self.command, "sync"), timeout)

    def count(self, event_name: str) -> int:
        """Return how many such events have happened."""
        return self._journal.counts[event_name]

    def running(self) -> set[str]:
        """Return the ids of accepted goals that have not ended; empty without a process."""
        return self._journal.running()

    @property
    def max_running(self) -> int:
        """Return the most goals that ever executed at one time."""
        return self._journal.max_running

    @property
    def stderr(self) -> str:
        """Return the end of what the process wrote to standard error, such as rclpy's log."""
        if self._stderr.closed:
            return self._last_stderr
        # pread does not move the file offset: the child shares it and writes there.
        descriptor = self._stderr.fileno()
        size = os.fstat(descriptor).st_size
        text = os.pread(descriptor, _STDERR_SHOWN, max(0, size - _STDERR_SHOWN))
        return text.decode(errors="replace")

    # -- controlling it -------------------------------------------------------------------

    def command(self, name: str, **arguments: Option | None) -> None:
        """Send the server a command, such as `command("release", n=2)`.

        Raises:
            RuntimeError: The process has ended.
        """
        line = json.dumps({"command": name, **arguments}).encode() + b"\n"
        with self._stdin_lock:
            stdin = self._process.stdin
            try:
                if stdin is None or stdin.closed:
                    raise BrokenPipeError
                stdin.write(line)
                stdin.flush()
            except BrokenPipeError:
                raise RuntimeError(f"the {self.name} server is not running") from None

    def release(self, n: int | None = None) -> None:
        """Open the gate at which goals wait (option `gate=1`).

        Args:
            n: How many goals to let through, in the order in which they came; `None` opens the gate
                until `command("hold")`.
        """
        self.command("release", n=n)

    # -- its life --------------------------------------------------------------------------

    @property
    def pid(self) -> int:
        """Return the id of the current or last process."""
        return self._process.pid

    @property
    def alive(self) -> bool:
        """Return whether the process runs (or is paused)."""
        return self._process.poll() is None

    @property
    def returncode(self) -> int | None:
        """Return the exit code, or minus the number of a signal; `None` while it runs."""
        return self._process.poll()

    def kill(self) -> int:
        """Send SIGKILL: the server vanishes without a message. Return the exit code.

        It waits at most half a second for a moment when the process does nothing. Otherwise the
        process might hold a lock of the middleware.
        """
        await_quiet(self.pid)
        return self._end(signal.SIGKILL)

    def terminate(self) -> int:
        """Send SIGTERM, for a clean end. Running goals are not aborted. Return the exit code."""
        return self._end(signal.SIGTERM)

    def interrupt(self) -> int:
        """Send SIGINT, as Ctrl-C does, for a clean end. Return the exit code."""
        return self._end(signal.SIGINT)

    def pause(self) -> None:
        """Send SIGSTOP and wait for it: the server stays in the ROS graph and answers nothing.

        Like `kill`, it waits for a moment when the process does nothing.
        """
        await_quiet(self.pid)
        self._process.send_signal(signal.SIGSTOP)
        os.waitid(os.P_PID, self.pid, os.WSTOPPED | os.WEXITED | os.WNOWAIT)

    def resume(self) -> None:
        """Send SIGCONT, which undoes `pause`."""
        self._process.send_signal(signal.SIGCONT)

    def restart(self) -> None:
        """End the current process, then start a new one with the same name and options.

        Servers that count goals, such as flaky and scripted, go on counting.

        Raises:
            RuntimeError: The new process did not start.
        """
        if self._stderr.closed:
            raise RuntimeError(f"the {self.name} server was stopped for good")
        self.terminate()
        self._launch()

    def stop(self) -> None:
        """End the process and free everything. It cannot be started again. Safe to call twice."""
        if self._stderr.closed:
            return
        self.terminate()
        self._last_stderr = self.stderr
        self._stderr.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def __repr__(self) -> str:
        state = "alive" if self.alive else f"exit code {self.returncode}"
        return f"<Server {self.name} on {self.action_name!r}, pid {self.pid}, {state}>"

    # -- private ---------------------------------------------------------------------------

    def _launch(self) -> None:
        command = [sys.executable, *self._program, self.name]
        command += ["--action", self.action_name, "--type", self._type_name]
        for key, value in self._options.items():
            command += ["--option", f"{key}={format_option(value)}"]
        # The same interpreter: if ROS comes from wheels, our environment has the library path from
        # their bootstrapper, which is right for the child, too.
        environment = {**os.environ, INSTANCE_VARIABLE: self._instance}
        environment[GOALS_VARIABLE] = str(self._journal.goals)
        if self._domain_id is not None:
            environment["ROS_DOMAIN_ID"] = str(self._domain_id)
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._stderr,
            env=environment,
            # Not in the terminal's process group: Ctrl-C is for the client, and the server must
            # live to cancel the goal. When we die, the child's stdin is closed, and it ends.
            start_new_session=True,
        )
        incarnation = self._journal.begin()
        name, stdout = f"journal-{self.name}", self._process.stdout
        self._reader = threading.Thread(target=self._read, args=(stdout,), name=name, daemon=True)
        self._reader.start()
        try:
            self._journal.wait_for("ready", incarnation=incarnation, timeout=_START_TIMEOUT)
        except EventNotSeenError as error:
            if error.ended:
                # Its stdout is closed; the process itself may need a moment more.
                with contextlib.suppress(subprocess.TimeoutExpired):
                    self._process.wait(_STOP_TIMEOUT)
            code = self.kill()
            problem = f"was not up within {_START_TIMEOUT:g} s"
            if error.ended:
                problem = f"ended while starting (exit code {code})"
            raise RuntimeError(
                f"the {self.name} server {problem}; it said:\n{self.stderr.rstrip()}"
            ) from None
        except BaseException:  # also Ctrl-C: the caller has no object yet to stop the process
            self.kill()
            raise

    def _read(self, stdout: IO[bytes]) -> None:
        with stdout:
            for line in stdout:
                self._journal.add_line(line)
        self._journal.end()

    def _end(self, number: signal.Signals) -> int:
        if self.alive:
            with contextlib.suppress(ProcessLookupError):
                self._process.send_signal(number)
                if number is not signal.SIGKILL:
                    # A paused process does not see a signal until it goes on.
                    self._process.send_signal(signal.SIGCONT)
        try:
            code = self._process.wait(_STOP_TIMEOUT)
        except subprocess.TimeoutExpired:
            self._process.kill()
            code = self._process.wait()
        with self._stdin_lock, contextlib.suppress(BrokenPipeError):
            if self._process.stdin is not None:
                self._process.stdin.close()
        # The journal is complete when its end of file was read.
        self._reader.join(_STOP_TIMEOUT)
        return code


def start(
    name: str,
    *,
    action_name: str = "fibonacci",
    action_type: type | str | None = None,
    domain_id: int | None = None,
    **options: Option,
) -> Server:
    """Start a reference server in its own process; return when it is ready.

    Use the returned `Server` in a `with` statement, or call its `stop()`. The process also ends if
    this process ends in any way.

    Args:
        name: The server's name; see `names`, or `python -m actionkit.servers --list`.
        action_name: The action to serve.
        action_type: The action's type, if it is not the server's own: a class, or a name such as
            `"my_robot/action/Pick"`. Most servers work with any type: then a goal has `steps=5`
            steps (an option), and feedback and results are empty messages. If a server does not,
            the error lists the servers that do. countdown and navigate use the types of
            `actionkit_interfaces` only if one is given here, even if the package is installed.
        domain_id: Its ROS domain; `None` means the environment's domain.
        options: The server's own options, such as `period=0.1`; a script is a list.

    Returns:
        The running server, which is already in the ROS graph.

    Raises:
        TypeError: `action_type` is not an action type.
        ValueError: There is no such server or option, the value of an option is wrong, or the
            server cannot serve that type.
        RuntimeError: The process ended, or was not ready within 20 seconds; the text has its
            output.
    """
    behaviour = behaviour_named(name)
    served = behaviour.action_type if action_type is None else name_of(action_type)
    foreign = is_foreign(name, served)
    behaviour.parse({key: format_option(value) for key, value in options.items()}, foreign=foreign)
    return Server(name, action_name, served, domain_id, options)

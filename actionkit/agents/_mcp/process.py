"""A process that serves a toolbox: from its beginning to its end, with any reason to end.

Hosts close standard input, send SIGTERM 2 seconds later and SIGKILL 2 seconds after that. A part
that hangs by then, even the event loop, does not hold up the cancelling or the end.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import select
import signal
import socket
import subprocess
import threading
import time
import traceback
import uuid
from collections.abc import Awaitable, Callable, Coroutine
from types import FrameType
from typing import Any, NoReturn

from mcp.server import Server

from actionkit import CancelReport, Ledger
from actionkit._internal_api import unfinished_goals, watch_over
from actionkit.agents._mcp import http
from actionkit.agents._mcp.address import Address
from actionkit.agents._mcp.calls import Calls
from actionkit.agents._mcp.session import make_server
from actionkit.agents._mcp.stdio import Stdio
from actionkit.agents._toolbox import Toolbox

_PATIENCE = 2.5
"""Seconds for the servers to confirm that the goals are cancelled."""
_LAST_WRITES = 0.3
"""Seconds to write the last answers."""
_FREEING = 0.7
"""Seconds to leave the ROS graph in order."""
_LAST = 3.7
"""Seconds after which the process ends, even if it waits for something."""
_FIRST = 10.0
"""Seconds to cancel what earlier processes have left, before the first call."""
_AGAIN = 60.0
"""Seconds of each further try."""
_PAUSE = 5.0
"""Seconds between two tries."""
_UNKNOWN = 23
"""The exit code where a goal may still be running; as `actionkit cancel` has it."""
_BROKEN = 1
"""The exit code where serving ended by itself."""
_NOT_DONE = (asyncio.TimeoutError, RuntimeError)
"""A step of the end took too long, or no thread could be started; the next ones go on."""
_EXITS = {signal.SIGINT: 130, signal.SIGTERM: 143, signal.SIGHUP: 129}

Serve = Callable[[Server[Any], "Ending"], Coroutine[Any, Any, None]]


def serve_stdio(toolbox: Toolbox, stdio: Stdio, version: str, ledger: Ledger) -> NoReturn:
    """Serve the host at the other end of standard input and output. Ends the process."""

    async def serve(server: Server[Any], ending: Ending) -> None:
        await stdio.serve(server, lambda: ending.ask(0, "the host closed its end"))

    _run(toolbox, version, ledger, serve, stdio.flush)


def serve_http(
    toolbox: Toolbox, where: Address, listening: socket.socket, version: str, ledger: Ledger
) -> NoReturn:
    """Serve clients over HTTP. Ends the process."""
    enough, over = asyncio.Event(), asyncio.Event()

    async def serve(server: Server[Any], ending: Ending) -> None:
        try:
            await http.serve(http.make_app(server, where), listening, enough)
        finally:
            over.set()

    async def answer_the_last() -> None:
        enough.set()
        await over.wait()

    _run(toolbox, version, ledger, serve, answer_the_last)


def _run(
    toolbox: Toolbox,
    version: str,
    ledger: Ledger,
    serve: Serve,
    flush: Callable[[], Awaitable[None]],
) -> NoReturn:
    try:
        asyncio.run(_serve(toolbox, version, ledger, serve, flush))
    except BaseException:  # noqa: BLE001  the process ends with it
        traceback.print_exc()
    os._exit(_BROKEN)


async def _serve(
    toolbox: Toolbox,
    version: str,
    ledger: Ledger,
    serve: Serve,
    flush: Callable[[], Awaitable[None]],
) -> None:
    ending = Ending(toolbox, _watcher(ledger))
    calls = Calls(toolbox, asyncio.ensure_future(asyncio.to_thread(cancel_leftovers, ledger)))
    # Beside serving, as it takes a second, and hosts wait for their first answer.
    opening = asyncio.ensure_future(toolbox.__aenter__())
    opening.add_done_callback(_tell_why)
    serving = asyncio.ensure_future(serve(make_server(toolbox, calls, version), ending))
    serving.add_done_callback(lambda _: ending.ask(_BROKEN, "serving has ended by itself"))
    await ending.asked.wait()
    with contextlib.suppress(*_NOT_DONE):
        await calls.end(_PATIENCE)
    with contextlib.suppress(*_NOT_DONE):
        await asyncio.wait_for(flush(), _LAST_WRITES)
    ending.name_goals_left()
    with contextlib.suppress(*_NOT_DONE):
        await asyncio.wait_for(toolbox.aclose(), _FREEING)
    if serving.done() and not serving.cancelled() and serving.exception() is not None:
        _say(f"ended ({ending.why}): {serving.exception()!r}")
    # Python would wait for what is written to a host that reads nothing (C10.3).
    ending.end()


def _tell_why(opening: asyncio.Future[Any]) -> None:
    if not opening.cancelled() and opening.exception() is not None:
        _say(f"the toolbox cannot be opened: {opening.exception()}")


class Ending:
    """Waits for a reason to end the process; the first one counts.

    Make it on the event loop, in the main thread.

    Attributes:
        asked: Set on the event loop when the process is to end.
        why: The reason, for people.
        code: The exit code.
    """

    def __init__(self, toolbox: Toolbox, watcher: subprocess.Popen[bytes] | None) -> None:
        self.asked = asyncio.Event()
        self.why = ""
        self.code = 0
        self._toolbox, self._watcher = toolbox, watcher
        self._left: list[str] | None = None
        self._loop = asyncio.get_running_loop()
        self._first = threading.Lock()
        self._reads, writes = os.pipe()
        os.set_blocking(writes, False)
        for number in _EXITS:
            # A signal that is ignored, as under `nohup`, stays ignored.
            if signal.getsignal(number) is not signal.SIG_IGN:
                signal.signal(number, _heard_elsewhere)
        signal.set_wakeup_fd(writes, warn_on_full_buffer=False)
        # Not `loop.add_signal_handler`: it does nothing while the loop hangs.
        threading.Thread(target=self._hear, name="mcp-signals", daemon=True).start()

    def ask(self, code: int, why: str) -> None:
        """Make the process end; only the first reason counts. From any thread."""
        if not self._first.acquire(blocking=False):
            return
        self.why, self.code = why, code
        timer = threading.Timer(_LAST, self._end_late)
        timer.daemon = True
        with contextlib.suppress(RuntimeError):  # no more threads: the event loop alone ends it
            timer.start()
        self._loop.call_soon_threadsafe(self.asked.set)
        self._toolbox._calls.cancel_all("all goals were cancelled")  # here, as the loop may hang

    def name_goals_left(self) -> None:
        """Tell people of the goals that may still run; only once."""
        if self._left is None:
            self._left = goals_left(self._toolbox, self._watcher)
            for line in self._left:
                _say(line)

    def end(self) -> NoReturn:
        """End the process now; with 23 in place of 0 where a goal may still be running."""
        os._exit(self.code or (_UNKNOWN if self._left else 0))

    def _hear(self) -> None:
        while True:
            for number in os.read(self._reads, 16):
                # The descriptor gets every signal that has a handler in Python, also others.
                if number in _EXITS and signal.getsignal(number) is _heard_elsewhere:
                    self.ask(_EXITS[signal.Signals(number)], signal.Signals(number).name)

    def _end_late(self) -> None:
        try:
            self.name_goals_left()
            _say("the end took too long")
        finally:
            self.end()


def _heard_elsewhere(number: int, frame: FrameType | None) -> None:
    """Do nothing: the signal is heard by its wakeup descriptor."""


def goals_left(toolbox: Toolbox, watcher: subprocess.Popen[bytes] | None) -> list[str]:
    """Return a line of text for each goal that may still run when this process ends.

    A server that hangs, or is stopped in a debugger, has not read our requests yet; and requests in
    shared memory are lost when their sender ends. So the watcher goes on.
    """
    watched = watcher is not None and watcher.poll() is None
    who = "another process" if watched else "nothing"
    return [
        f"goal {goal['goal_id']} of {toolbox.action_of(goal['tool'])} may still be running;"
        f" {who} goes on cancelling it"
        for goal in toolbox.goals()
        if goal["may_still_run"] and goal["goal_id"] is not None
    ]


def _watcher(ledger: Ledger) -> subprocess.Popen[bytes] | None:
    """Start the process that cancels what this one leaves running."""
    try:
        return watch_over(ledger.path)
    except OSError as error:
        _say(
            f"no process can be started ({error})."
            " If this one is killed, its goals run on until the next start"
        )
        return None


def cancel_leftovers(ledger: Ledger) -> None:
    """Cancel what earlier processes have left running, before anything else is sent.

    What does not stop in ten seconds is cancelled again and again on a thread of its own.
    """
    told: dict[uuid.UUID, CancelReport] = {}
    if _cancel_once(ledger, _FIRST, told):
        with contextlib.suppress(RuntimeError):  # no more threads
            threading.Thread(target=_go_on, args=(ledger, told), daemon=True).start()


def _go_on(ledger: Ledger, told: dict[uuid.UUID, CancelReport]) -> None:
    while _cancel_once(ledger, _AGAIN, told):
        time.sleep(_PAUSE)


def _cancel_once(ledger: Ledger, seconds: float, told: dict[uuid.UUID, CancelReport]) -> bool:
    """Cancel what is left over, and tell what is new; return whether to try again."""
    try:
        for goal, report in ledger.cancel(seconds).items():
            if told.get(goal.goal_id) is not report:
                told[goal.goal_id] = report
                _say(
                    f"goal {goal.goal_id} of {goal.action_name}, left by an earlier process:"
                    f" {report}"
                )
        return unfinished_goals(ledger)
    except Exception as error:  # noqa: BLE001  they stay in the ledger
        _say(f"goals of earlier processes may still be running: {error!r}")
        return False


def _say(words: str) -> None:
    """Tell people something, on standard error, which hosts keep in their logs."""
    text = f"actionkit mcp: {words}\n".encode(errors="replace")
    with contextlib.suppress(OSError, ValueError):  # nobody is there to read it
        # A host that reads nothing must not delay the end: a pipe with any room takes up to
        # PIPE_BUF bytes at once.
        if select.select([], [2], [], 0)[1]:
            os.write(2, text[: select.PIPE_BUF])

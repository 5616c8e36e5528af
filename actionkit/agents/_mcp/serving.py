"""A process that serves a toolbox: from its beginning to its end, with any reason to end."""

from __future__ import annotations

import asyncio
import contextlib
import socket
import traceback
from collections.abc import Awaitable, Callable, Coroutine
from typing import Any, NoReturn

from mcp.server import Server

from actionkit.agents._mcp import http
from actionkit.agents._mcp.address import Address
from actionkit.agents._mcp.calls import Calls
from actionkit.agents._mcp.ending import PATIENCE, Ending, leave, say
from actionkit.agents._mcp.left_behind import go_on_cancelling
from actionkit.agents._mcp.session import make_server
from actionkit.agents._mcp.stdio import Stdio
from actionkit.agents._toolbox import Toolbox

_LAST_WRITES = 0.3
"""Seconds to write the last answers."""
_FREEING = 0.7
"""Seconds to leave the ROS graph as it should be done."""
UNKNOWN = 23
"""The exit code where a goal may still be running; as `actionkit cancel` has it."""
BROKEN = 1
"""The exit code where serving ended by itself."""

Serve = Callable[[Server[Any], Ending], Coroutine[Any, Any, None]]


def serve_stdio(toolbox: Toolbox, stdio: Stdio, version: str) -> NoReturn:
    """Serve the host at the other end of standard input and output. Ends the process."""

    async def serve(server: Server[Any], ending: Ending) -> None:
        await stdio.serve(server, lambda: ending.ask(0, "the host closed its end"))

    _run(toolbox, version, serve, stdio.flush)


def serve_http(
    toolbox: Toolbox, where: Address, listening: socket.socket, version: str
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

    _run(toolbox, version, serve, answer_the_last)


def _run(
    toolbox: Toolbox, version: str, serve: Serve, flush: Callable[[], Awaitable[None]]
) -> NoReturn:
    try:
        asyncio.run(_serve(toolbox, version, serve, flush))
    except BaseException:  # noqa: BLE001  the process ends with it
        traceback.print_exc()
    leave(BROKEN)


def _tell_why(opening: asyncio.Future[Any]) -> None:
    if not opening.cancelled() and opening.exception() is not None:
        say(f"the toolbox cannot be opened: {opening.exception()}")


async def _serve(
    toolbox: Toolbox, version: str, serve: Serve, flush: Callable[[], Awaitable[None]]
) -> NoReturn:
    ending = Ending(toolbox.close, lambda: go_on_cancelling(toolbox))
    calls = Calls(toolbox)
    # Beside serving, as it takes a second, and hosts wait for their first answer.
    opening = asyncio.ensure_future(toolbox.__aenter__())
    opening.add_done_callback(_tell_why)
    server = make_server(toolbox, calls, version)
    serving = asyncio.ensure_future(serve(server, ending))
    serving.add_done_callback(lambda _: ending.ask(BROKEN, "serving has ended by itself"))
    await ending.asked.wait()
    await calls.end(PATIENCE)
    with contextlib.suppress(asyncio.TimeoutError):
        await asyncio.wait_for(flush(), _LAST_WRITES)
    left = ending.leave_behind()
    with contextlib.suppress(asyncio.TimeoutError):
        await asyncio.wait_for(toolbox.aclose(), _FREEING)
    if serving.done() and not serving.cancelled() and serving.exception() is not None:
        say(f"ended ({ending.why}): {serving.exception()!r}")
    # What still waits for a host that reads nothing would hold up an orderly end (C10.3).
    leave(ending.code or (UNKNOWN if left else 0))

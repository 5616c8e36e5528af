"""MCP over standard input and output; nothing else in the process can use them.

Imports nothing heavy: they are taken before libraries, which may print, are imported. All that is
written to standard output afterwards, in Python or in C, goes to standard error.
"""

from __future__ import annotations

import asyncio
import contextlib
import fcntl
import io
import json
import os
import select
import sys
import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mcp.server import Server

MOST_BYTES = 4 * 1024 * 1024
"""The longest message that is read, as for the body of an HTTP request."""
_HEAD = 200
"""Bytes in which to look for the id of a request; so few cannot be nested too deeply."""
RUNS_ALREADY = -32600, "a request with this id still runs; this one was refused: nothing was done"
"""With such an id, the SDK would forget the first request, and nothing could cancel its goal."""


class Stdio:
    """The host's end of the two pipes, as the files that the SDK's transport takes."""

    def __init__(self) -> None:
        """Take descriptors 0 and 1.

        Raises:
            OSError: One of them is closed.
        """
        reads, writes = (fcntl.fcntl(number, fcntl.F_DUPFD_CLOEXEC, 3) for number in (0, 1))
        for number in (reads, writes):
            os.set_blocking(number, True)  # each blocks only a thread
        self._input, self._output = os.fdopen(reads, "rb"), os.fdopen(writes, "wb")
        nothing = os.open(os.devnull, os.O_RDWR)
        os.dup2(nothing, 0)
        try:
            os.dup2(2, 1)
        except OSError:  # standard error is closed
            os.dup2(nothing, 1)
        os.close(nothing)
        if isinstance(sys.stdout, io.TextIOWrapper):
            sys.stdout.reconfigure(line_buffering=True)  # as it is where people read it
        self._running: set[Any] = set()  # ids of requests

    async def serve(self, server: Server[Any], gone: Callable[[], object]) -> None:
        """Serve the host. `gone` is called, from a thread, when it has closed either pipe."""
        from mcp.server.stdio import stdio_server

        self._gone = gone
        threading.Thread(target=self._watch, name="mcp-host", daemon=True).start()
        files: Any = self  # it has what the transport uses of anyio's files
        async with stdio_server(files, files) as (reads, writes):
            await server.run(reads, writes, server.create_initialization_options())

    async def write(self, text: str) -> None:
        """Write, and return when it is written. Cancelling ends the wait, not the writing."""
        await asyncio.to_thread(self._answer, text)

    async def flush(self) -> None:
        """Return when everything that was given to `write` is written."""
        await self.write("")

    def __aiter__(self) -> Stdio:
        return self

    async def __anext__(self) -> str:
        """Return the next message. Answer those that cannot be read: the SDK would ignore them."""
        while line := await asyncio.to_thread(self._read):
            message, problem = _parsed(line)
            if message is not None and not self._runs_already(message):
                return line.decode(errors="replace")
            if line.strip():
                code, text = (-32700, f"{problem}; nothing was done") if problem else RUNS_ALREADY
                error = {"code": code, "message": text}
                answer = {"jsonrpc": "2.0", "id": request_id(line), "error": error}
                await asyncio.to_thread(self._write, json.dumps(answer).encode() + b"\n")
        raise StopAsyncIteration

    def _runs_already(self, message: Any) -> bool:
        """Return whether it is a request with the id of one that runs; remember other ids."""
        from mcp.shared.dispatcher import coerce_request_id

        method, number = getattr(message, "method", None), getattr(message, "id", None)
        if method == "notifications/cancelled":  # its request is never answered
            cancelled = (message.params or {}).get("requestId")
            if isinstance(cancelled, (str, int)):
                self._running.discard(coerce_request_id(cancelled))
        if method is None or number is None:
            return False
        before = len(self._running)
        self._running.add(coerce_request_id(number))
        return len(self._running) == before

    # -- in threads ------------------------------------------------------------------------

    def _read(self) -> bytes:
        """Return a line, without its end if it is too long; `b""` when the host is gone."""
        line = rest = b""
        with contextlib.suppress(OSError):
            line = rest = self._input.readline(MOST_BYTES)
            while rest and not rest.endswith(b"\n"):
                rest = self._input.readline(MOST_BYTES)
        if not rest:
            self._gone()
        return line if rest else b""

    def _answer(self, text: str) -> None:
        from mcp.shared.dispatcher import coerce_request_id
        from pydantic_core import from_json

        if text and "method" not in (message := from_json(text)):
            self._running.discard(coerce_request_id(message["id"]))
        self._write(text.encode(errors="replace"))

    def _write(self, data: bytes) -> None:
        try:
            self._output.write(data)
            self._output.flush()
        except OSError:
            self._gone()

    def _watch(self) -> None:
        # A child of a killed host may still keep our input open; our output shows the end.
        poll = select.poll()
        poll.register(self._output, 0)  # errors are always reported
        poll.poll()
        self._gone()


def _parsed(line: bytes) -> tuple[Any, str]:
    """Return a message, and `""`; or `None`, and why it cannot be read."""
    from mcp.types import jsonrpc_message_adapter
    from pydantic import ValidationError

    if not line.endswith(b"\n"):
        return None, f"the message is longer than {MOST_BYTES} bytes"
    try:
        return jsonrpc_message_adapter.validate_json(line[:-1], by_name=False), ""
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False, include_context=False)[0]
        return None, f"the message cannot be read ({first['msg'][:200]})"


def request_id(line: bytes) -> str | int | None:
    """Return the id of a request, if all of it, or its beginning where it is broken, says it."""
    from pydantic_core import from_json

    found: Any = None
    try:
        found = json.loads(line)  # takes half characters, too
    except (ValueError, RecursionError):
        with contextlib.suppress(ValueError):
            # Up to a comma: half a number would look like a whole one.
            found = from_json(line[:_HEAD].rpartition(b",")[0], allow_partial=True)
    if not isinstance(found, dict) or "method" not in found:
        return None  # an answer has an id of ours
    number = found.get("id")
    return number if isinstance(number, (str, int)) and not isinstance(number, bool) else None

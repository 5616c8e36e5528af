"""MCP over standard input and output."""

from __future__ import annotations

import json
from typing import Any

import mcp.types as t
from mcp.server import Server
from mcp.server.stdio import stdio_server
from pydantic import ValidationError

from actionkit.agents._mcp.wire import MOST_BYTES, TooLong, Wire


async def serve(server: Server[Any], wire: Wire) -> None:
    """Serve the host until it closes its end."""
    # They are what the transport needs of anyio's files: lines to iterate over, and `write`.
    lines: Any = _Lines(wire)
    output: Any = _Output(wire)
    async with stdio_server(lines, output) as (reads, writes):
        await server.run(reads, writes, server.create_initialization_options())


class _Output:
    def __init__(self, wire: Wire) -> None:
        self._wire = wire

    async def write(self, text: str) -> None:
        await self._wire.write(text.encode(errors="replace"))

    async def flush(self) -> None:
        """Do nothing: what is written is not held back."""


class _Lines:
    """The messages that can be read; what cannot be is answered here.

    The SDK passes over such lines, and the host would wait for an answer for ever.
    """

    def __init__(self, wire: Wire) -> None:
        self._wire = wire

    def __aiter__(self) -> _Lines:
        return self

    async def __anext__(self) -> str:
        while line := await self._wire.line():
            problem = _problem(line)
            if not problem:
                return line.decode(errors="replace")
            if line.strip():
                answer = {
                    "jsonrpc": "2.0",
                    "id": _id_of(line.decode(errors="replace")),
                    "error": {"code": t.PARSE_ERROR, "message": problem},
                }
                await self._wire.write(json.dumps(answer).encode() + b"\n")
        raise StopAsyncIteration


def _problem(line: bytes) -> str:
    if isinstance(line, TooLong):
        return f"the message is longer than {MOST_BYTES} bytes; nothing was done"
    try:
        t.jsonrpc_message_adapter.validate_json(line, by_name=False)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False, include_context=False)[0]
        return f"the message cannot be read ({first['msg'][:200]}); nothing was done"
    return ""


def _id_of(line: str) -> str | int | None:
    """Return the id of a request that cannot be read, so that its sender can be told.

    Only what is outside of all inner objects and arrays is looked at: what is wrong is mostly
    how deep these are.
    """
    kept: list[str] = []
    depth, in_text, escaped = 0, False, False
    for character in line:
        if in_text:
            in_text = escaped or character != '"'
            escaped = character == "\\" and not escaped
        elif character == '"':
            in_text = True
        elif character in "{[":
            depth += 1
            if depth == 2:
                kept.append("null")
        if depth == 1:
            kept.append(character)
        if not in_text and character in "}]":
            depth -= 1
    try:
        found = json.loads("".join(kept) + ("}" if depth else ""))["id"]
    except (ValueError, KeyError, TypeError, RecursionError):
        return None
    return found if isinstance(found, (str, int)) and not isinstance(found, bool) else None

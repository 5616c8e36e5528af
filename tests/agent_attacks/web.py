"""HTTP: who may come in, and what a client can do to the others."""
# ruff: noqa: RUF001

from __future__ import annotations

import asyncio
import contextlib
import json
import socket
import time
from collections.abc import AsyncIterator, Callable
from typing import Any
from urllib.parse import urlsplit

import httpx2

from tests.agent_attacks.approval import FORM, YES
from tests.agent_attacks.places import (
    Place,
    ended,
    left_running,
    modern_meta,
    orders,
    received,
    tried,
    unclean,
)
from tests.agents.over_mcp.lab import HttpServing
from tests.agents.over_mcp.test_mcp_http import HEADERS, open_session

TOKEN = "a-secret-of-the-attacks-0123456789"
KNOWN = f"Authorization: Bearer {TOKEN}"
JSON = "Content-Type: application/json\r\nAccept: application/json, text/event-stream"
MODERN = "MCP-Protocol-Version: 2026-07-28\r\nMcp-Method: tools/call\r\nMcp-Name: count"


def _body(tool: str = "count", **arguments: Any) -> str:
    params = {"name": tool, "arguments": arguments or {"order": 3}, "_meta": modern_meta({})}
    return json.dumps({"jsonrpc": "2.0", "id": 1, "method": "tools/call", "params": params})


def _request(
    *headers: str,
    line: str = "POST /mcp HTTP/1.1",
    host: str = "127.0.0.1",
    body: str | None = None,
) -> bytes:
    """Return a whole request that would send a goal, if it were let in."""
    body = _body() if body is None else body
    first = [line, *([f"Host: {host}"] if host else []), JSON, MODERN, *headers]
    return "\r\n".join(
        [*first, f"Content-Length: {len(body.encode('utf-8', 'surrogateescape'))}", "", body]
    ).encode("utf-8", "surrogateescape")


_CALL = {"jsonrpc": "2.0", "id": 7, "method": "tools/call"}
_COUNT = {**_CALL, "id": 8, "params": {"name": "count", "arguments": {"order": 1}}}
T = TOKEN
# fmt: off
# Without the token, or with one that is none.
TOKENS: dict[str, bytes] = {
    f"token: {ascii(header)[:60] or 'missing'}": _request(*([header] if header else []))
    for header in (*("", "Authorization:", "Authorization: Bearer", "Authorization: Bearer ",
        f"Authorization: {T}"), *(f"Authorization: Bearer {T[:-1]}", f"Authorization: Bearer {T}x",
        f"Authorization: Bearer {T[1:]}"), *(f"Authorization: Bearer {T.upper()}",
        f"Authorization: Bearer {T} x", f"Authorization: Bearer {T}, Bearer x"),
        *(f"Authorization: Bearer {T[:-1]}９", f"Authorization: Bearer {T}\u200b",
        "Authorization: Bearer \udcff"), *(f"Authorization: Basic {T}", f"Authorization: Token {T}",
        f"Authorization: Bearer\t{T}x", f"X-Authorization: Bearer {T}"), *(f"Cookie: token={T}",
        f"Proxy-Authorization: Bearer {T}", f'Authorization: Bearer "{T}"',
        "Authorization: Bearer null"), *(f"Authorization: Bearer {T}\x00",
        "Authorization: Bearer " + "x" * 10_000, "Authorization: Bearer *"),
        *("Authorization: Bearer wrong\r\nAuthorization: Bearer wrong2",
        "Authorization: Bearer wrong\r\nX: y"))
} | {
    f"token missing: {line}": _request(line=line)
    for line in (*("POST /mcp/ HTTP/1.1", "POST //mcp HTTP/1.1", "POST /./mcp HTTP/1.1",
        "POST /x/../mcp HTTP/1.1", "POST /%6dcp HTTP/1.1"), *(f"POST /mcp?token={T} HTTP/1.1",
        f"POST /mcp?access_token={T} HTTP/1.1", "POST http://127.0.0.1/mcp HTTP/1.1"),
        *("GET /mcp HTTP/1.1", "DELETE /mcp HTTP/1.1", "OPTIONS /mcp HTTP/1.1", "PUT /mcp HTTP/1.1",
        "HEAD /mcp HTTP/1.1"), *("POST /mcp HTTP/1.0", "POST /mcp%00 HTTP/1.1",
        "POST /MCP HTTP/1.1", "POST * HTTP/1.1",
        "GET /.well-known/oauth-protected-resource HTTP/1.1"))
} | {
    "token missing: a second request in the body": _request(body=_request(KNOWN).decode(),
        line="GET /x HTTP/1.1").replace(KNOWN.encode(), b"X: y"),
    "token missing: another method than it says": _request("X-HTTP-Method-Override: POST",
        line="GET /mcp HTTP/1.1"),
    "token missing: two lengths": _request("Content-Length: 0"),
    "token missing: a length, and chunks": _request("Transfer-Encoding: chunked"),
}
# With the token, from another name, or as a page of another site.
NAMES: dict[str, bytes] = {
    f"Host: {host!a}": _request(KNOWN, host=host)
    for host in (*("evil.test", "evil.test:80", "127.0.0.1.evil.test", "127.0.0.1:80.evil.test",
        "127.0.0.1:80@evil.test", "localhost:"), *("evil.test:127.0.0.1", "evil.test, 127.0.0.1",
        "127.0.0.1, evil.test", "evil.test#127.0.0.1", "localhost.", "2130706433"), *("0.0.0.0",
        "[::]", "[::1", "::1", "[::1]evil.test", "127.1", "127.0.0.2", "user@127.0.0.1",
        "127.0.0.1:evil", "ｌocalhost"))
} | {
    "Host: missing": _request(KNOWN, host=""),
    "Host: twice": _request(KNOWN, "Host: evil.test"),
    "Host: another in the line": _request(KNOWN, host="evil.test",
        line="POST http://127.0.0.1/mcp HTTP/1.1"),
    "Host: forwarded": _request(KNOWN, "X-Forwarded-Host: 127.0.0.1", "Forwarded: host=127.0.0.1",
        host="evil.test"),
} | {
    f"Origin: {origin!a}": _request(KNOWN, f"Origin: {origin}")
    for origin in (*("http://evil.test", "https://evil.test", "null", "file://",
        "http://127.0.0.1.evil.test", "http://localhost.evil.test"),
        *("http://localhost:80.evil.test", "http://localhost:80@evil.test",
        "http://evil.test:127.0.0.1", "http://evil.test/127.0.0.1"), *("ftp://127.0.0.1",
        "http://evil.test, http://127.0.0.1", "http://127.0.0.1 http://evil.test",
        "chrome-extension://x", "*"))
} | {
    f"a page that needs no leave: {kind}": _request(KNOWN,
        "Origin: http://evil.test").replace(b"application/json\r", kind.encode() + b"\r")
    for kind in ("text/plain", "application/x-www-form-urlencoded", "multipart/form-data")
}
_LENGTH = f"Content-Length: {len(_body())}\r\n".encode()
# With the token: nothing may hang or die, or be taken for a call.
SIZES: dict[str, bytes] = {
    "a body of 5 MB": _request(KNOWN, body="x" * 5_000_000),
    "a body of 100 GB": _request(KNOWN, "Content-Length: 99999999999").replace(_LENGTH, b""),
    "a negative length": _request(KNOWN).replace(b"Content-Length: ", b"Content-Length: -"),
    "chunks of 6 MB": _request(KNOWN, "Transfer-Encoding: chunked").partition(b"Content-Length")[0]
    + b"\r\n" + (b"10000\r\n" + b" " * 65536 + b"\r\n") * 96,
    "headers of 1 MB": _request(KNOWN, *(f"X{n}: {'x' * 1000}" for n in range(1000))),
    "a line of 1 MB": _request(KNOWN, line=f"POST /mcp?{'x' * 1_000_000} HTTP/1.1"),
    "arguments 10,000 deep": _request(KNOWN, body=_body().replace('"arguments": {',
        '"arguments": {"a": ' + "[" * 10_000 + "]" * 10_000 + ", ")),
    "no JSON": _request(KNOWN, body="{"),
    "no UTF-8": _request(KNOWN, body='{"jsonrpc": "\udcff"}'),
    "a batch": _request(KNOWN, body=f"[{_body()}, {_body()}]"),
    "another tool than the header says": _request(KNOWN, body=_body("patrol")),
    "duplicate keys": _request(KNOWN, body=_body().replace('"order": 3',
        '"order": 3, "order": 99')),
}

# fmt: on


class Web:
    """A server over HTTP that needs the token, and what its attackers do."""

    def __init__(self, place: Place) -> None:
        self.place = place
        self.serving = HttpServing(place.robot, ACTIONKIT_MCP_TOKEN=TOKEN)
        parts = urlsplit(self.serving.url)
        self.address = (str(parts.hostname), int(parts.port or 0))
        place.robot.server("fibonacci", period=0.02)
        place.robot.server("never_finishes")

    def raw(self, request: bytes, seconds: float = 15.0) -> tuple[int, bytes]:
        """Send bytes; return the status (0 if the connection is closed) and what came back."""
        came = b""
        with (
            socket.create_connection(self.address, seconds) as connected,
            contextlib.suppress(ConnectionError),
        ):
            connected.sendall(request)
            while part := connected.recv(65536):
                came += part
                head, found, body = came.partition(b"\r\n\r\n")
                if found and (b"data: {" in body or _is_whole(head, body)):
                    break
        status = came.split(b" ", 2)[1] if came.startswith(b"HTTP/1.1 ") else b"0"
        return int(status), came

    def enters(self, request: bytes, may_enter: bool = False) -> str:
        since = time.monotonic()
        try:
            status, came = self.raw(request)
        except TimeoutError:
            return "it neither answers nor closes the connection"
        if got := orders(self.place.robot.server("fibonacci"), since):
            return f"let in: goals {got}, status {status}"
        if not may_enter and status in (200, 202, 204):
            return f"let in: status {status}: {came[-300:]!r}"
        body = came.partition(b"\r\n\r\n")[2].decode(errors="replace")
        return f"status {status}" if status >= 500 else unclean(body)

    def log(self) -> str:
        text = self.serving.log.read_text()
        return "".join(f"{one!r} is in the log" for one in (TOKEN, "Traceback") if one in text)

    # -- sessions ----------------------------------------------------------------------------

    async def session(self, client: httpx2.AsyncClient) -> dict[str, str]:
        return {"Mcp-Session-Id": await open_session(client, self.serving.url, FORM)}

    async def post(self, client: httpx2.AsyncClient, mine: dict[str, str], message: Any) -> int:
        message = {"jsonrpc": "2.0", **message}
        return (await client.post(self.serving.url, json=message, headers=mine)).status_code

    async def beside(self, attack: Callable[[httpx2.AsyncClient, dict[str, str]], Any]) -> str:
        """Attack a call of another client; it must go on."""
        patrolling, since = self.place.robot.server("never_finishes"), time.monotonic()
        async with self.client() as victim, self.client() as client:
            its, mine = await self.session(victim), await self.session(client)
            call = {**_CALL, "params": {"name": "patrol", "arguments": {}}}
            calling = asyncio.ensure_future(self.post(victim, its, call))
            count = patrolling.count("executing") + 1
            await asyncio.to_thread(patrolling.wait_for, "executing", count=count)
            wrong = await attack(client, mine)
            await self.post(client, mine, _COUNT)  # by its end, the other has ended if it does
            (goal,) = received(patrolling, since)
            if ended(patrolling, goal) or calling.done():
                wrong = wrong or f"the call of another client has ended: {calling}"
            await victim.delete(self.serving.url, headers=its)
            await asyncio.wait([calling], timeout=10.0)
        left = await left_running(patrolling, since)
        return wrong or (f"left: {left}" if left else "")

    def client(self) -> httpx2.AsyncClient:
        names = {"Authorization": f"Bearer {TOKEN}", **HEADERS}
        return httpx2.AsyncClient(headers=names, timeout=None)

    async def cancels(self, client: httpx2.AsyncClient, mine: dict[str, str]) -> str:
        for number in (7, "7", 1, 0):
            message = {"method": "notifications/cancelled", "params": {"requestId": number}}
            await self.post(client, mine, message)
            await self.post(client, {"MCP-Protocol-Version": "2026-07-28"}, message)
        return ""

    async def approves(self) -> str:
        """Answer the question of another client, whose ids can be guessed."""
        since = time.monotonic()
        async with self.client() as victim, self.client() as client:
            its, mine = await self.session(victim), await self.session(client)
            call = {**_CALL, "params": {"name": "ask", "arguments": {"order": 3}}}
            async with victim.stream("POST", self.serving.url, json=call, headers=its) as stream:
                async for line in stream.aiter_lines():
                    if "elicitation/create" in line:
                        break
                for number in range(5):
                    for names in (mine, {"MCP-Protocol-Version": "2026-07-28"}):
                        await self.post(client, names, {"id": number, "result": YES})
                await self.post(client, mine, _COUNT)  # by its end, the other has begun if it does
            await victim.delete(self.serving.url, headers=its)
        got = orders(self.place.robot.server("fibonacci"), since)
        return f"goals {got}" if got != [1] else ""


def _is_whole(head: bytes, body: bytes) -> bool:
    lengths = [
        int(line.split(b":")[1])
        for line in head.lower().split(b"\r\n")
        if line.startswith(b"content-length:")
    ]
    return (bool(lengths) and len(body) >= lengths[0]) or b"0\r\n\r\n" in body


async def attacks(place: Place) -> AsyncIterator[tuple[str, str]]:
    """Yield the name of each attack, and what is wrong, `""` where it failed."""
    web = Web(place)
    place.robot.stack.callback(web.serving.close)
    status, came = await asyncio.to_thread(web.raw, _request(KNOWN))
    yield (
        "an honest client is let in",
        "" if status == 200 and b"succeeded" in came else f"{status} {came[-300:]!r}",
    )
    for name, request in (TOKENS | NAMES).items():
        yield name, await tried(web.enters, request)
    for name, request in SIZES.items():
        yield name, await tried(web.enters, request, True)
    yield "an answer to another's question", await tried(web.approves)
    yield "cancels of another's request", await tried(web.beside, web.cancels)
    yield "the log", web.log()
    yield "it serves on", "" if not web.serving.is_gone() else "it is gone"

"""MCP over streamable HTTP: who may come in, limits for all, and that a dead connection is noticed.

Limits hold before the token is checked, so that clients without it lock out nobody.
"""

from __future__ import annotations

import asyncio
import contextlib
import hmac
import json
import logging
import re
import resource
import socket
from collections.abc import Iterator
from typing import Any

import uvicorn
from mcp.server import Server
from mcp.server.auth.middleware.bearer_auth import BearerAuthBackend, RequireAuthMiddleware
from mcp.server.auth.provider import AccessToken
from mcp.server.streamable_http import LAST_EVENT_ID_HEADER, MCP_SESSION_ID_HEADER
from mcp.server.transport_security import RequestBodyLimitMiddleware, TransportSecuritySettings
from mcp.shared.dispatcher import coerce_request_id
from starlette.datastructures import Headers
from starlette.middleware.authentication import AuthenticationMiddleware
from starlette.responses import Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from uvicorn.protocols.http.h11_impl import H11Protocol

from actionkit.agents._mcp.address import Address
from actionkit.agents._mcp.session import GONE
from actionkit.agents._mcp.stdio import MOST_BYTES, RUNS_ALREADY, request_id

PATH = "/mcp"
_MOST_CONNECTIONS = 256
_MOST_REQUESTS = 512
"""At a time. uvicorn compares it with connections, too, and has to find fewer."""
_REQUEST_WITHIN = 10.0
"""Seconds until a whole request has come."""
_MOST_SESSIONS = 256
_SESSION_IDLE = 300.0
"""Seconds; a session in which a call runs, or that has a stream open, is not idle."""
_NAMED = re.compile(rb"(https?://)?(\[[0-9A-Fa-f:.]+\]|[^:/@\s\[\]]+)(:[0-9]{1,5})?")
"""A host or an origin. The SDK knows the names, but takes anything for a port."""
_MISNAMED = {b"host": 421, b"origin": 403}
"""The HTTP status if the header is malformed."""
_RESUMES = LAST_EVENT_ID_HEADER.encode()
_RECORDS_A_MINUTE = 20
_LONGEST_RECORD = 300


def make_app(server: Server[Any], where: Address) -> ASGIApp:
    """Return the ASGI application."""
    hosts = [text for name in where.names for text in (name, f"{name}:*")]
    security = TransportSecuritySettings(
        allowed_hosts=hosts,
        # Browsers alone send an origin; a page of another site is none of these.
        allowed_origins=[f"{scheme}://{host}" for scheme in ("http", "https") for host in hosts],
    )
    inner: ASGIApp = server.streamable_http_app(
        streamable_http_path=PATH,
        transport_security=security,
        max_request_body_size=MOST_BYTES,
        max_sessions=_MOST_SESSIONS,
        session_idle_timeout=_SESSION_IDLE,
    )
    # Each message that `_OneOfAnId` gets is a whole body.
    guarded: ASGIApp = _Watched(RequestBodyLimitMiddleware(_OneOfAnId(inner), MOST_BYTES))
    if where.token:
        guarded = AuthenticationMiddleware(
            RequireAuthMiddleware(guarded, []), backend=BearerAuthBackend(_OneToken(where.token))
        )

    async def app(scope: Scope, receive: Receive, send: Send) -> None:
        # The SDK begins and ends with the application's life, which no client asks for.
        chosen = inner if scope["type"] == "lifespan" else guarded
        await chosen(scope, receive, send)

    return app


class _OneToken:
    """Knows the one token."""

    def __init__(self, token: str) -> None:
        self._token = token.encode()

    async def verify_token(self, token: str) -> AccessToken | None:
        if not hmac.compare_digest(token.encode(errors="replace"), self._token):
            return None
        return AccessToken(token="", client_id="actionkit", scopes=[])


class _Watched:
    """Tells handlers that the connection of their request is dead.

    The SDK cancels what a dead connection asked for in the era of 2026-07-28 alone. Before that, a
    client may come back for the answer where the server keeps it; here it is not kept, so nobody
    could ever hear of it.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            return  # no web sockets here
        for name, value in scope["headers"]:
            if name in _MISNAMED and not _NAMED.fullmatch(value):
                await Response(status_code=_MISNAMED[name])(scope, receive, send)
                return
        # Nothing is kept for a client that comes back; the SDK would not answer at all.
        scope["headers"] = [one for one in scope["headers"] if one[0] != _RESUMES]
        gone = asyncio.Event()
        watcher: asyncio.Task[None] | None = None

        async def watch() -> None:
            while (await receive())["type"] != "http.disconnect":
                pass
            gone.set()

        async def receive_and_watch() -> Message:
            nonlocal watcher
            if watcher is not None:
                await gone.wait()
                return {"type": "http.disconnect"}
            message = await receive()
            if message["type"] == "http.disconnect":
                gone.set()
            elif not message.get("more_body", False):
                watcher = asyncio.ensure_future(watch())
            return message

        scope[GONE] = gone  # `_Connection` looks for it, too
        try:
            await self._app(scope, receive_and_watch, send)
        finally:
            if watcher is not None:
                watcher.cancel()


class _OneOfAnId:
    """Refuses a request with the id of one that runs in the same session; see `RUNS_ALREADY`."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app
        self._running: set[object] = set()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        session = Headers(scope=scope).get(MCP_SESSION_ID_HEADER)
        if session is None or scope["method"] != "POST":
            await self._app(scope, receive, send)
            return
        message: Message | None = await receive()
        assert message is not None
        number = request_id(message.get("body", b""))
        key = None if number is None else (session, coerce_request_id(number))
        if key in self._running:
            error = dict(zip(("code", "message"), RUNS_ALREADY, strict=True))
            answer = json.dumps({"jsonrpc": "2.0", "id": number, "error": error})
            await Response(answer, 400, media_type="application/json")(scope, receive, send)
            return

        async def receive_again() -> Message:
            nonlocal message
            first, message = message, None
            return first or await receive()

        if key is not None:
            self._running.add(key)
        try:
            await self._app(scope, receive_again, send)
        finally:
            self._running.discard(key)


class _Connection(H11Protocol):
    """A connection that is closed if no request comes, or if others need its place.

    Never while a request is served: that would cancel a goal.
    """

    _timer: asyncio.TimerHandle

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        self._wait()
        descriptors, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
        if len(self.connections) > min(_MOST_CONNECTIONS, descriptors // 4):
            every = [one for one in self.connections if isinstance(one, _Connection)]
            waiting = [one for one in every if one._waits]
            # Those that had the token come last; this new one, if all others serve a request.
            min(waiting, key=lambda one: (one is self, one._let_in, one._timer.when()))._give_up()

    @property
    def _let_in(self) -> bool:
        """Whether its last request had the token, if one is needed."""
        return self.cycle is not None and GONE in self.cycle.scope

    @property
    def _waits(self) -> bool:
        """Whether it serves no whole request of a client that was let in.

        The client may still be reading the answer: it says what happened to a goal.
        """
        answered = self.cycle is not None and self.cycle.response_complete
        read = answered and not self.transport.get_write_buffer_size()
        return not self._let_in or read or self.cycle.more_body

    def _wait(self) -> None:
        self._timer = self.loop.call_later(_REQUEST_WITHIN, self._give_up)

    def _give_up(self) -> None:
        if self._waits:
            self.connections.discard(self)
            self.transport.abort()
        elif self.cycle.response_complete:
            self._wait()  # the client is still reading

    def on_response_complete(self) -> None:
        self._timer.cancel()
        self._wait()
        super().on_response_complete()

    def connection_lost(self, exc: Exception | None) -> None:
        self._timer.cancel()
        super().connection_lost(exc)


class _Few(logging.Filter):
    """Lets libraries log a few short records a minute: clients must not fill the disk."""

    _minute = _count = 0

    def filter(self, record: logging.LogRecord) -> bool:
        if record.name.partition(".")[0] == "actionkit":
            return True
        minute = int(record.created) // 60
        self._count = self._count + 1 if minute == self._minute else 1
        self._minute = minute
        more = " (no more in this minute)" if self._count == _RECORDS_A_MINUTE else ""
        with contextlib.suppress(Exception):  # wrong arguments: `logging` reports that itself
            record.msg, record.args = f"{record.getMessage()[:_LONGEST_RECORD]}{more}", ()
        return self._count <= _RECORDS_A_MINUTE


class _Uvicorn(uvicorn.Server):
    """One that leaves signals to us, and lets more connections wait than it accepts at once."""

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        yield

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        await super().startup(sockets)
        for one in sockets or []:
            one.listen(128)


async def serve(app: ASGIApp, listening: socket.socket, enough: asyncio.Event) -> None:
    """Serve until there is enough."""
    config = uvicorn.Config(
        app,
        http=_Connection,
        # asyncio accepts so many in one turn of its loop. With one, a request is read before its
        # place is taken, and no faster than requests are served.
        backlog=1,
        # Those of lost connections count, too: they go on for a moment.
        limit_concurrency=_MOST_REQUESTS,
        ws="none",
        loop="asyncio",
        lifespan="on",
        log_config=None,
        access_log=False,
        server_header=False,
        proxy_headers=False,
        timeout_graceful_shutdown=1,
    )
    for handler in (logging.lastResort, *logging.getLogger().handlers):
        if handler is not None:
            handler.addFilter(_Few())
    server = _Uvicorn(config)
    serving = asyncio.ensure_future(server.serve(sockets=[listening]))
    waiting = asyncio.ensure_future(enough.wait())
    try:
        await asyncio.wait([serving, waiting], return_when=asyncio.FIRST_COMPLETED)
    finally:
        waiting.cancel()
        server.should_exit = True
    await serving

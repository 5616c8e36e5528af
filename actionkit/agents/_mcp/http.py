"""MCP over streamable HTTP: who may come in, and that a dead connection is noticed."""

from __future__ import annotations

import asyncio
import contextlib
import hmac
import socket
from collections.abc import Iterator
from typing import Any

import uvicorn
from mcp.server import Server
from mcp.server.auth.middleware.bearer_auth import BearerAuthBackend, RequireAuthMiddleware
from mcp.server.auth.provider import AccessToken
from mcp.server.transport_security import TransportSecuritySettings
from starlette.middleware.authentication import AuthenticationMiddleware
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from actionkit.agents._mcp.address import Address
from actionkit.agents._mcp.session import GONE

PATH = "/mcp"


def make_app(server: Server[Any], where: Address) -> ASGIApp:
    """Return the ASGI application."""
    hosts = [text for name in where.names for text in (name, f"{name}:*")]
    security = TransportSecuritySettings(
        allowed_hosts=hosts,
        # Browsers alone send an origin; a page of another site is none of these.
        allowed_origins=[f"{scheme}://{host}" for scheme in ("http", "https") for host in hosts],
    )
    inner: ASGIApp = server.streamable_http_app(
        streamable_http_path=PATH, transport_security=security
    )
    guarded = inner
    if where.token:
        guarded = AuthenticationMiddleware(
            RequireAuthMiddleware(inner, []), backend=BearerAuthBackend(_OneToken(where.token))
        )
    watched = _Watched(guarded)

    async def app(scope: Scope, receive: Receive, send: Send) -> None:
        # The SDK begins and ends with the application's life, which no client asks for.
        chosen = inner if scope["type"] == "lifespan" else watched
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

        try:
            await self._app({**scope, GONE: gone}, receive_and_watch, send)
        finally:
            if watcher is not None:
                watcher.cancel()


class _Uvicorn(uvicorn.Server):
    """One that leaves signals to us."""

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        yield


async def serve(app: ASGIApp, listening: socket.socket, enough: asyncio.Event) -> None:
    """Serve until there is enough."""
    config = uvicorn.Config(
        app,
        http="h11",
        ws="none",
        loop="asyncio",
        lifespan="on",
        log_config=None,
        access_log=False,
        server_header=False,
        proxy_headers=False,
        timeout_graceful_shutdown=1,
    )
    server = _Uvicorn(config)
    serving = asyncio.ensure_future(server.serve(sockets=[listening]))
    waiting = asyncio.ensure_future(enough.wait())
    try:
        await asyncio.wait([serving, waiting], return_when=asyncio.FIRST_COMPLETED)
    finally:
        waiting.cancel()
        server.should_exit = True
    await serving

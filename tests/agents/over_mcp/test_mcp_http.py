"""HTTP: who may connect, and connections that end without a message."""

from __future__ import annotations

import asyncio
import contextlib
import json
import signal
import socket
import sys
import time
from collections.abc import Iterator
from urllib.parse import urlsplit

import httpx2
import pytest
from mcp import Client
from mcp.client.streamable_http import streamable_http_client

from actionkit.agents._mcp.address import TOKEN_VARIABLE
from tests import forked
from tests.agents.over_mcp import flooder, leaver, page
from tests.agents.over_mcp.lab import (
    PATIENCE,
    WAYS,
    HttpServing,
    Robot,
    Watch,
    Way,
    agent,
    words,
)
from tests.faults import network

HTTP = WAYS[2:]
TOKEN = "a-secret-of-the-test"
HEADERS = {"Content-Type": "application/json", "Accept": "application/json, text/event-stream"}
_CALL = {"jsonrpc": "2.0", "id": 1, "method": "tools/call"}
SHORT_LIMITS = """
import actionkit.agents._mcp.http as limits
limits._REQUEST_WITHIN = limits._SESSION_IDLE = 1.5
"""
TWO_PLACES = """
import actionkit.agents._mcp.http as limits
limits._MOST_CONNECTIONS = 2
"""


def raw_call(
    way: Way, number: int | str, session: str, host: str, tool: str = "patrol", **arguments: int
) -> bytes:
    """Return a whole HTTP request that calls a tool."""
    params: dict[str, object] = {"name": tool, "arguments": arguments}
    headers = {**HEADERS, "Host": host, "MCP-Protocol-Version": way.era}
    if way.mode == "legacy":
        headers["Mcp-Session-Id"] = session
    else:
        headers |= {"Mcp-Method": "tools/call", "Mcp-Name": tool}
        key = "io.modelcontextprotocol/"
        params["_meta"] = {
            f"{key}protocolVersion": way.era,
            f"{key}clientInfo": {"name": "test", "version": "0"},
            f"{key}clientCapabilities": {},
        }
    body = json.dumps({**_CALL, "id": number, "params": params}).encode()
    lines = [f"{name}: {value}" for name, value in headers.items()]
    head = "\r\n".join(["POST /mcp HTTP/1.1", *lines, f"Content-Length: {len(body)}", "", ""])
    return head.encode() + body


async def open_session(
    client: httpx2.AsyncClient, url: str, capabilities: dict[str, object] | None = None
) -> str:
    hello = {
        "protocolVersion": "2025-11-25",
        "capabilities": capabilities or {},
        "clientInfo": {"name": "test", "version": "0"},
    }
    message = {"jsonrpc": "2.0", "id": 0, "method": "initialize", "params": hello}
    answer = await client.post(url, json=message, headers=HEADERS)
    session: str = answer.headers["mcp-session-id"]
    message = {"jsonrpc": "2.0", "method": "notifications/initialized"}
    await client.post(url, json=message, headers={**HEADERS, "Mcp-Session-Id": session})
    return session


@pytest.mark.parametrize("way", HTTP, ids=str)
def test_a_client_that_is_gone_before_its_call_begins(
    robot: Robot, http: HttpServing, way: Way
) -> None:
    watch = Watch(robot.server("never_finishes"))
    place = urlsplit(http.url).netloc
    address = (urlsplit(http.url).hostname, urlsplit(http.url).port)

    async def scenario() -> None:
        async with agent(robot, way, http) as connected:
            # The toolbox knows its server: a goal would be sent within a millisecond.
            calling = asyncio.ensure_future(connected.call("patrol", {}))
            await watch.until("executing")
            calling.cancel()
            await watch.until("canceled")
            assert watch.received
            later = Watch(watch.server)
            async with httpx2.AsyncClient() as client:
                session = await open_session(client, http.url)
            # Whoever it is, it says its piece, and hangs up in the same moment.
            for number in range(1, 6):
                request = raw_call(way, number, session, place)
                with socket.create_connection(address) as leaving:
                    leaving.sendall(request)
            # The same request of one that stays is taken.
            with socket.create_connection(address) as staying:
                staying.sendall(raw_call(way, 6, session, place))
                await later.until("executing")
                assert len(later.received) == 1
            await later.until("canceled")
        fault = "the client is gone before its call begins"
        page.record(page.HTTP_ONLY, fault, way, "nothing", "nothing: it is gone")

    asyncio.run(scenario())


def test_a_client_that_ends_its_session(robot: Robot, http: HttpServing) -> None:
    watch = Watch(robot.server("never_finishes"))

    async def scenario() -> None:
        async with httpx2.AsyncClient(timeout=PATIENCE) as client:
            headers = {**HEADERS, "Mcp-Session-Id": await open_session(client, http.url)}
            message = {**_CALL, "params": {"name": "patrol", "arguments": {}}}
            calling = asyncio.ensure_future(client.post(http.url, json=message, headers=headers))
            await watch.until("executing")
            assert (await client.delete(http.url, headers=headers)).status_code == 200
            reached = await watch.summary()
            assert (await calling).text.strip() == ""
        fault = "the client ends its session (DELETE)"
        page.record(page.HTTP_ONLY, fault, HTTP[0], reached, "no answer")

    asyncio.run(scenario())


def test_an_id_that_is_used_again_while_its_call_runs(robot: Robot, http: HttpServing) -> None:
    watch = Watch(robot.server("never_finishes"))

    async def scenario() -> None:
        async with httpx2.AsyncClient(timeout=PATIENCE) as client:
            headers = {**HEADERS, "Mcp-Session-Id": await open_session(client, http.url)}

            async def post(**message: object) -> httpx2.Response:
                whole = {"jsonrpc": "2.0", **message}
                return await client.post(http.url, json=whole, headers=headers)

            params = {"name": "patrol", "arguments": {}}
            calling = asyncio.ensure_future(post(id=7, method="tools/call", params=params))
            await watch.until("executing")
            again = await asyncio.wait_for(post(id="7", method="tools/call", params=params), 20)
            assert (again.status_code, again.json()["id"]) == (400, "7")
            assert "a request with this id still runs" in again.json()["error"]["message"]
            await post(method="notifications/cancelled", params={"requestId": 7})
            assert await watch.summary() == "a goal, canceled"
            assert '"id":7' in (await calling).text
            assert (await post(id=7, method="ping")).status_code == 200

    asyncio.run(scenario())


def test_a_client_that_comes_back_for_events(http: HttpServing) -> None:
    """No answer has an id to go on from, so such a request is as any other."""

    async def scenario() -> None:
        async with httpx2.AsyncClient(timeout=PATIENCE) as client:
            headers = {**HEADERS, "Mcp-Session-Id": await open_session(client, http.url)}
            headers["Last-Event-ID"] = "1"
            async with client.stream("GET", http.url, headers=headers) as answer:
                assert answer.status_code == 200
                assert answer.headers["content-type"].startswith("text/event-stream")

    asyncio.run(scenario())


@pytest.mark.parametrize("way", HTTP, ids=str)
@pytest.mark.long
def test_a_client_that_hangs(robot: Robot, http: HttpServing, way: Way) -> None:
    """Its machine acknowledges what is sent to it, so nothing tells it from one that waits."""
    watch = Watch(robot.server("never_finishes"))
    told = {"mode": way.mode, "url": http.url, "tool": "hurry"}
    client = forked.Popen([sys.executable, leaver.__file__, json.dumps(told)])
    try:
        asyncio.run(watch.until("executing"))
        client.send_signal(signal.SIGSTOP)
        reached = asyncio.run(watch.summary())
    finally:
        client.kill()
        client.wait()

    async def later() -> str:
        async with agent(robot, way, http) as connected:
            (goal,) = (g for g in await connected.goals() if g["goal_id"] in watch.received)
            return f"nothing; then `{goal['status']}`: the tool's time ran out"

    fault = "the client hangs (SIGSTOP)"
    page.record(page.HTTP_ONLY, fault, way, reached, asyncio.run(later()))


def address_of(serving: HttpServing) -> tuple[str, int]:
    parts = urlsplit(serving.url)
    assert parts.port is not None
    return str(parts.hostname), parts.port


def first_answer(serving: HttpServing, request: bytes) -> bytes:
    """Send something; return the first bytes of the answer, none if the connection is closed."""
    with socket.create_connection(address_of(serving), PATIENCE) as connected:
        try:
            connected.sendall(request)
            return connected.recv(1000)
        except ConnectionError:
            return b""


@pytest.mark.parametrize("way", HTTP, ids=str)
def test_limits_of_time_are_not_for_calls(robot: Robot, way: Way) -> None:
    watch = Watch(robot.server("never_finishes"))

    async def scenario(serving: HttpServing) -> None:
        async with httpx2.AsyncClient() as client:
            idle = await open_session(client, serving.url)
            session = await open_session(client, serving.url)
        with socket.create_connection(address_of(serving)) as calling:
            # No other connection, so nothing else keeps its session.
            calling.sendall(raw_call(way, 1, session, urlsplit(serving.url).netloc))
            await watch.until("executing")
            for request in (b"", b"POST", raw_call(way, 2, session, "127.0.0.1")[:-1]):
                assert await asyncio.to_thread(first_answer, serving, request) == b""
            message = {"jsonrpc": "2.0", "id": 3, "method": "ping"}
            async with httpx2.AsyncClient() as client:

                async def ping(session: str) -> int:
                    headers = {**HEADERS, "Mcp-Session-Id": session}
                    return (
                        await client.post(serving.url, json=message, headers=headers)
                    ).status_code

                assert await ping(idle) == 404
                if way.mode == "legacy":
                    assert await ping(session) == 200
            await asyncio.to_thread(watch.server.sync)
            assert not any(e.event == "canceled" for e in watch.events)
        assert await watch.summary() == "a goal, canceled"

    with contextlib.closing(HttpServing(robot, before=SHORT_LIMITS)) as serving:
        asyncio.run(scenario(serving))


@pytest.mark.long
def test_an_answer_is_kept_for_a_client_that_reads_slowly(robot: Robot) -> None:
    watch = Watch(robot.server("fibonacci", period=0.02))
    long = "x" * 3_900_000  # more than the kernel keeps

    async def scenario(serving: HttpServing) -> None:
        with socket.socket() as slow:
            slow.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            slow.connect(address_of(serving))
            slow.settimeout(PATIENCE)
            place = urlsplit(serving.url).netloc
            request = raw_call(HTTP[1], long, "", place, "count", order=1)
            await asyncio.to_thread(slow.sendall, request)
            await watch.until("succeeded")
            for _ in range(2):  # each takes as long as the limit
                assert await asyncio.to_thread(first_answer, serving, b"") == b""
            parts: list[bytes] = []
            while sum(map(len, parts)) < len(long) or b"succeeded" not in b"".join(parts):
                parts.append(await asyncio.to_thread(slow.recv, 1_000_000))
                assert parts[-1], "the connection was closed"

    with contextlib.closing(HttpServing(robot, before=SHORT_LIMITS)) as serving:
        asyncio.run(scenario(serving))


def test_calls_keep_their_places(robot: Robot) -> None:
    watch = Watch(robot.server("never_finishes"))

    async def scenario(serving: HttpServing) -> None:
        place = urlsplit(serving.url).netloc
        hello = flooder.KINDS["initialize"].encode()
        assert (await asyncio.to_thread(first_answer, serving, hello)).startswith(b"HTTP/1.1 200")
        with socket.create_connection(address_of(serving)) as first:
            with socket.create_connection(address_of(serving)) as second:
                first.sendall(raw_call(HTTP[1], 1, "", place))
                second.sendall(raw_call(HTTP[1], 2, "", place))
                await watch.until("executing", 2)
                assert await asyncio.to_thread(first_answer, serving, hello) == b""
                await asyncio.to_thread(watch.server.sync)
                assert not any(e.event == "canceled" for e in watch.events)
            await watch.until("canceled")
            assert (await asyncio.to_thread(first_answer, serving, hello)).startswith(b"HTTP/1.1 2")
        assert await watch.summary() == "a goal, canceled; a goal, canceled"

    with contextlib.closing(HttpServing(robot, before=TWO_PLACES)) as serving:
        asyncio.run(scenario(serving))


@pytest.mark.long
def test_who_may_come_in(robot: Robot) -> None:
    watch = Watch(robot.server("fibonacci", period=0.02))
    with contextlib.closing(
        HttpServing(robot, "--allow-host", "robot.test", **{TOKEN_VARIABLE: TOKEN})
    ) as serving:

        async def scenario() -> None:
            known = {**HEADERS, "Authorization": f"Bearer {TOKEN}"}
            message = json.dumps({**_CALL, "params": {"name": "count", "arguments": {"order": 3}}})
            async with httpx2.AsyncClient() as client:

                async def told(**headers: str) -> str:
                    answer = await client.post(serving.url, content=message, headers=headers)
                    return str(answer.status_code)

                wrong = {**known, "Authorization": f"Bearer {TOKEN}x"}
                assert await told(**HEADERS) == await told(**wrong) == "401"
                fault = "no token, or a wrong one"
                page.record(page.HTTP_ONLY, fault, "HTTP", await watch.summary(), "HTTP status 401")
                for fault, header, text, allowed in (
                    ("another `Host` (DNS rebinding)", "Host", "evil.test", "robot.test:80"),
                    (
                        "another `Origin` (a web page)",
                        "Origin",
                        "http://evil.test",
                        "http://robot.test",
                    ),
                ):
                    status = await told(**known, **{header: text})
                    reached = await watch.summary()
                    page.record(page.HTTP_ONLY, fault, "HTTP", reached, f"HTTP status {status}")
                    # It comes in, and is told that it has opened no session.
                    assert await told(**known, **{header: allowed}) == "400"
                for header, text, status in (
                    ("Host", "127.0.0.1:1.evil.test", "421"),
                    ("Host", "localhost:1@evil.test", "421"),
                    ("Origin", "http://localhost:1.evil.test", "403"),
                    ("Host", "[::1]:8765", "400"),
                    ("Origin", "https://localhost:8765", "400"),
                ):
                    assert await told(**known, **{header: text}) == status, text
            with_token = httpx2.AsyncClient(
                timeout=PATIENCE,  # its default is 5 s, and a first call takes 4
                headers={"Authorization": f"Bearer {TOKEN}"},
            )
            async with with_token as client:
                transport = streamable_http_client(serving.url, http_client=client)
                async with Client(transport) as connected:
                    assert words(await connected.call_tool("count", {"order": 3})) == "`succeeded`"

        asyncio.run(scenario())


@pytest.fixture(scope="module")
def cable() -> Iterator[network.Network]:
    """Two hosts (network namespaces) and the cable between them."""
    reason = network.why_not()
    if reason:
        pytest.skip(reason)
    with network.two_hosts() as made:
        yield made


@pytest.mark.long
def test_the_network_is_cut(robot: Robot, cable: network.Network) -> None:
    """TCP would tell of it after a quarter of an hour, or never."""
    here, there = cable.first, cable.second
    with here.inside(), contextlib.ExitStack() as stack:
        (listed,) = json.loads(
            forked.run(
                ["ip", "-j", "-4", "addr", "show", "up", "scope", "global"],
                capture_output=True,
                check=True,
                text=True,
            ).stdout
        )
        address = listed["addr_info"][0]["local"]
        # The other way round for HTTP alone: the robot is here, and the agent there.
        patrolling = robot_server_here(robot, stack)
        environment = {TOKEN_VARIABLE: TOKEN}
        serving = HttpServing(robot, at=f"{address}:0", **environment)
        stack.callback(serving.close)
        for way in HTTP:
            watch = Watch(patrolling)
            told = {"mode": way.mode, "url": serving.url, "token": TOKEN}
            with there.inside():
                client = forked.Popen([sys.executable, leaver.__file__, json.dumps(told)])
            stack.callback(client.wait)
            stack.callback(client.kill)
            asyncio.run(watch.until("executing"))
            began = time.monotonic()
            cable.cut()
            reached = asyncio.run(watch.summary())
            assert time.monotonic() - began < 20.0
            cable.mend()
            fault = "the network between client and server is cut"
            page.record(page.HTTP_ONLY, fault, way, reached, "nothing: it is gone")


def robot_server_here(robot: Robot, stack: contextlib.ExitStack):
    """Start the action server in this network namespace."""
    from actionkit import servers

    return stack.enter_context(
        servers.start("never_finishes", action_name="never_finishes", domain_id=robot.domain)
    )

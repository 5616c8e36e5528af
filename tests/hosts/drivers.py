"""The hosts: programs and libraries that call an MCP server's tools for a language model.

Run in a host's own environment, `python drivers.py HOST STEP TARGET`, so it imports nothing but the
host. `TARGET` is a JSON object: `url`, or `command`, `args` and `env`. What happened is one line of
JSON on standard output. A line on standard input says when to go on.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import sys
import threading
from collections.abc import AsyncIterator, Awaitable, Callable
from datetime import timedelta
from importlib import import_module
from typing import Any

Call = Callable[[str, dict[str, Any]], Awaitable[str]]
LIMIT = 3.0
"""Seconds that a host is told to wait for a call, in the step `timeout`."""
LONG = 300.0


class Connected:
    """A host's connection: which tools it has, and how it calls them."""

    def __init__(self, tools: list[str], call: Call) -> None:
        self.tools = tools
        self.call = call


class Step:
    """What one step needs of a host.

    Attributes:
        limit: The host's own time limit for a call; `None` where its default is to be seen.
        progress: How many times the host told of progress.
        asked: How many times it asked for an approval.
    """

    def __init__(self, name: str) -> None:
        self.limit = LIMIT if name == "timeout" else None if name == "default" else LONG
        self.progress = 0
        self.asked = 0

    async def on_progress(self, *_: Any, **__: Any) -> None:
        self.progress += 1


def text_of(result: Any) -> str:
    """Return what a model would read."""
    content = getattr(result, "content", result)
    blocks = content if isinstance(content, list) else [content]
    return " ".join(str(getattr(one, "text", one)) for one in blocks)


@contextlib.asynccontextmanager
async def sdk_1(target: dict[str, Any], step: Step) -> AsyncIterator[Connected]:
    mcp, types = import_module("mcp"), import_module("mcp.types")

    async def approve(*_: Any) -> Any:
        step.asked += 1
        return types.ElicitResult(action="accept", content={"approve": True})

    limit = None if step.limit is None else timedelta(seconds=step.limit)
    async with contextlib.AsyncExitStack() as stack:
        if "url" in target:
            http = import_module("mcp.client.streamable_http").streamablehttp_client
            reads, writes, _ = await stack.enter_async_context(http(target["url"]))
        else:
            stdio = import_module("mcp.client.stdio").stdio_client
            parameters = mcp.StdioServerParameters(**target)
            reads, writes = await stack.enter_async_context(stdio(parameters))
        session = await stack.enter_async_context(
            mcp.ClientSession(reads, writes, elicitation_callback=approve)
        )
        await session.initialize()

        async def call(name: str, arguments: dict[str, Any]) -> str:
            more = {"read_timeout_seconds": limit, "progress_callback": step.on_progress}
            return text_of(await session.call_tool(name, arguments, **more))

        yield Connected([tool.name for tool in (await session.list_tools()).tools], call)


@contextlib.asynccontextmanager
async def sdk_2(target: dict[str, Any], step: Step) -> AsyncIterator[Connected]:
    mcp, types = import_module("mcp"), import_module("mcp.types")

    async def approve(*_: Any) -> Any:
        step.asked += 1
        return types.ElicitResult(action="accept", content={"approve": True})

    where = target.get("url") or mcp.StdioServerParameters(**target)
    async with mcp.Client(where, elicitation_callback=approve) as client:

        async def call(name: str, arguments: dict[str, Any]) -> str:
            more = {"read_timeout_seconds": step.limit, "progress_callback": step.on_progress}
            return text_of(await client.call_tool(name, arguments, **more))

        yield Connected([tool.name for tool in (await client.list_tools()).tools], call)


def _fastmcp_transport(target: dict[str, Any]) -> Any:
    transports = import_module("fastmcp.client.transports")
    if "url" in target:
        return transports.StreamableHttpTransport(target["url"])
    return transports.StdioTransport(**target)


def _fastmcp_approve(step: Step) -> Any:
    async def approve(message: str, response_type: Any, *_: Any) -> Any:
        step.asked += 1
        return response_type(approve=True)

    return approve


@contextlib.asynccontextmanager
async def fastmcp(target: dict[str, Any], step: Step) -> AsyncIterator[Connected]:
    client = import_module("fastmcp").Client(
        _fastmcp_transport(target),
        elicitation_handler=_fastmcp_approve(step),
        progress_handler=step.on_progress,
    )
    async with client:

        async def call(name: str, arguments: dict[str, Any]) -> str:
            more = {"timeout": step.limit, "raise_on_error": False}
            return text_of(await client.call_tool(name, arguments, **more))

        yield Connected([tool.name for tool in await client.list_tools()], call)


@contextlib.asynccontextmanager
async def pydantic_ai(target: dict[str, Any], step: Step) -> AsyncIterator[Connected]:
    limit = {} if step.limit is None else {"read_timeout": step.limit}
    toolset = import_module("pydantic_ai.mcp").MCPToolset(
        _fastmcp_transport(target),
        elicitation_handler=_fastmcp_approve(step),
        progress_handler=step.on_progress,
        **limit,
    )
    async with toolset:

        async def call(name: str, arguments: dict[str, Any]) -> str:
            return json.dumps(await toolset.direct_call_tool(name, arguments), default=str)

        yield Connected([tool.name for tool in await toolset.list_tools()], call)


def _langchain(target: dict[str, Any], step: Step) -> Any:
    callbacks, types = import_module("langchain_mcp_adapters.callbacks"), import_module("mcp.types")

    async def approve(*_: Any) -> Any:
        step.asked += 1
        return types.ElicitResult(action="accept", content={"approve": True})

    connection = dict(target) | {"transport": "streamable_http" if "url" in target else "stdio"}
    if step.limit is not None:
        connection["session_kwargs"] = {"read_timeout_seconds": timedelta(seconds=step.limit)}
    return import_module("langchain_mcp_adapters.client").MultiServerMCPClient(
        {"robot": connection},
        callbacks=callbacks.Callbacks(on_progress=step.on_progress, on_elicitation=approve),
    )


def _langchain_tools(tools: list[Any]) -> Connected:
    by_name = {tool.name: tool for tool in tools}

    async def call(name: str, arguments: dict[str, Any]) -> str:
        return text_of(await by_name[name].ainvoke(arguments))

    return Connected(list(by_name), call)


@contextlib.asynccontextmanager
async def langchain(target: dict[str, Any], step: Step) -> AsyncIterator[Connected]:
    yield _langchain_tools(await _langchain(target, step).get_tools())


@contextlib.asynccontextmanager
async def langchain_session(target: dict[str, Any], step: Step) -> AsyncIterator[Connected]:
    client = _langchain(target, step)
    load = import_module("langchain_mcp_adapters.tools").load_mcp_tools
    async with client.session("robot") as session:
        yield _langchain_tools(await load(session, callbacks=client.callbacks))


@contextlib.asynccontextmanager
async def openai_agents(target: dict[str, Any], step: Step) -> AsyncIterator[Connected]:
    agents = import_module("agents.mcp")
    cls = agents.MCPServerStreamableHttp if "url" in target else agents.MCPServerStdio
    limit = {} if step.limit is None else {"client_session_timeout_seconds": step.limit}
    async with cls(params=target, **limit) as server:

        async def call(name: str, arguments: dict[str, Any]) -> str:
            return text_of(await server.call_tool(name, arguments))

        yield Connected([tool.name for tool in await server.list_tools()], call)


@contextlib.asynccontextmanager
async def smolagents(target: dict[str, Any], step: Step) -> AsyncIterator[Connected]:
    limit = {} if step.limit is None else {"client_session_timeout_seconds": step.limit}
    where = dict(target) | {"transport": "streamable-http"}
    if "url" not in target:
        where = import_module("mcp").StdioServerParameters(**target)
    client = import_module("smolagents").MCPClient(
        where, adapter_kwargs=limit, structured_output=False
    )
    by_name = {tool.name: tool for tool in client.get_tools()}

    async def call(name: str, arguments: dict[str, Any]) -> str:
        return str(await asyncio.to_thread(lambda: by_name[name](**arguments)))

    try:
        yield Connected(list(by_name), call)
    finally:
        client.disconnect()


HOSTS: dict[str, Any] = {
    "sdk-1": sdk_1,
    "sdk-2": sdk_2,
    "fastmcp": fastmcp,
    "pydantic-ai": pydantic_ai,
    "langchain": langchain,
    "langchain-session": langchain_session,
    "openai-agents": openai_agents,
    "smolagents": smolagents,
}


def say(**told: Any) -> None:
    print(json.dumps(told), flush=True)


async def go() -> None:
    """Wait for a line on standard input."""
    loop, line = asyncio.get_running_loop(), asyncio.Event()

    def read() -> None:
        sys.stdin.readline()
        with contextlib.suppress(RuntimeError):
            loop.call_soon_threadsafe(line.set)

    threading.Thread(target=read, daemon=True).start()
    await line.wait()


def _words(error: BaseException) -> str:
    while inside := getattr(error, "exceptions", ()):  # of a group
        error = inside[0]
    return f"{type(error).__name__}: {error}"


async def _told(calling: Awaitable[str]) -> dict[str, Any]:
    try:
        return {"text": await calling}
    except Exception as error:  # noqa: BLE001  what a host raises is what is to be seen
        return {"raised": _words(error)}


async def main(host: str, name: str, target: dict[str, Any]) -> None:
    step = Step(name)
    async with HOSTS[host](target, step) as connected:
        if name == "tools":
            say(tools=connected.tools)
        elif name == "call":
            told = await _told(connected.call("count", {"order": 20}))
            say(**told, progress=step.progress)
        elif name == "default":
            say(**await _told(connected.call("slow", {"order": 10})))
        elif name == "approve":
            told = await _told(connected.call("ask", {"order": 3}))
            say(**told, asked=step.asked)
        else:
            calling = asyncio.ensure_future(connected.call("patrol", {}))
            if name == "cancel":
                await go()
                calling.cancel()
                await asyncio.wait([calling], timeout=5.0)
                say(ended=calling.done())
            else:
                say(**await _told(calling))
            await go()  # connected until it has been seen what becomes of the goal


if __name__ == "__main__":
    asyncio.run(main(sys.argv[1], sys.argv[2], json.loads(sys.argv[3])))

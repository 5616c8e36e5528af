"""A program with a client of the SDK: it calls a tool, and is killed or stopped meanwhile."""

from __future__ import annotations

import asyncio
import json
import sys

import httpx2
from mcp import Client, StdioServerParameters
from mcp.client.streamable_http import streamable_http_client


async def main() -> None:
    told = json.loads(sys.argv[1])
    # Its default is 5 s: on a busy machine, a first call has been given up by then.
    headers = {"Authorization": f"Bearer {told.get('token')}"}
    async with httpx2.AsyncClient(headers=headers, timeout=60.0) as http:
        server = (
            streamable_http_client(told["url"], http_client=http)
            if told["url"]
            else StdioServerParameters(**told["stdio"])
        )
        async with Client(server, mode=told["mode"]) as client:
            await client.call_tool(told.get("tool", "patrol"), {})


if __name__ == "__main__":
    asyncio.run(main())

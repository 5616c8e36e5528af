"""A program with a client of the SDK in it, which calls a tool and is killed meanwhile."""

from __future__ import annotations

import asyncio
import json
import sys

from mcp import Client, StdioServerParameters


async def main() -> None:
    told = json.loads(sys.argv[1])
    server = told["url"] if told["url"] else StdioServerParameters(**told["stdio"])
    async with Client(server, mode=told["mode"]) as client:
        await client.call_tool("patrol", {})


if __name__ == "__main__":
    asyncio.run(main())

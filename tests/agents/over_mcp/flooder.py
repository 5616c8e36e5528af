"""A program that opens connections without end, so many a second, and keeps the newest open."""

from __future__ import annotations

import contextlib
import itertools
import json
import resource
import socket
import sys
import time
from collections import deque

HEAD = "POST /mcp HTTP/1.1\r\nHost: 127.0.0.1\r\n"
JSON = "Content-Type: application/json\r\nAccept: application/json, text/event-stream\r\n"
WRONG = f"{HEAD}{JSON}Authorization: Bearer wrong\r\n"
HELLO = json.dumps(
    {
        "jsonrpc": "2.0",
        "id": 0,
        "method": "initialize",
        "params": {
            "protocolVersion": "2025-11-25",
            "capabilities": {},
            "clientInfo": {"name": "flooder", "version": "0"},
        },
    }
)
KINDS = {
    "nothing": "",
    "half a head": HEAD,
    "a head without end": f"{HEAD}X: {'x' * 60_000}",
    "no HTTP": "\x16\x03\x01\r\n\r\n",
    "half a body": f"{WRONG}Content-Length: 4000000\r\n\r\n{'x' * 50_000}",
    "another protocol": f"{HEAD}Connection: upgrade\r\nUpgrade: websocket\r\n\r\n",
    "a wrong token": f"{WRONG}Content-Length: 2\r\n\r\n{{}}",
    "requests, and reads no answer": f"{WRONG}Content-Length: 2\r\n\r\n{{}}" * 100,
    "another host": f"{HEAD.replace('127', 'x' * 8_000)}{JSON}Content-Length: 2\r\n\r\n{{}}",
    "initialize": f"{HEAD}{JSON}Content-Length: {len(HELLO)}\r\n\r\n{HELLO}",
}


def main() -> None:
    """Open connections of some kinds in turn; print how many there have been."""
    port, kept, rate, *kinds = sys.argv[1:]
    _, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))
    opened: deque[socket.socket] = deque()
    began = time.monotonic()
    for number, kind in enumerate(itertools.cycle(kinds), 1):
        time.sleep(max(0.0, began + number / int(rate) - time.monotonic()))
        with contextlib.suppress(OSError):
            opened.append(socket.create_connection(("127.0.0.1", int(port)), timeout=5.0))
            opened[-1].setblocking(False)
            opened[-1].send(KINDS[kind].encode("latin-1"))
        if len(opened) > int(kept):
            opened.popleft().close()
        if number % 100 == 0:
            print(number, flush=True)


if __name__ == "__main__":
    main()

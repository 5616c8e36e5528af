"""The host's end of standard input and output, in a process that only sends messages back."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from actionkit.agents._mcp.stdio import MOST_BYTES, RUNS_ALREADY, request_id
from tests import forked
from tests.agents.over_mcp.lab import PATIENCE

_GONE = 7
_ECHO = f"""
import asyncio, os, time
from actionkit.agents._mcp.stdio import Stdio

stdio = Stdio()

from mcp.shared.message import SessionMessage
from mcp.types import JSONRPCResponse

class Echo:
    def create_initialization_options(self):
        pass

    async def run(self, reads, writes, options):
        async for item in reads:
            if item.message.method == "hang":
                os.write(2, b"hangs")
                time.sleep(60)
            if item.message.method in ("wait", "notifications/cancelled"):
                continue
            answer = JSONRPCResponse(jsonrpc="2.0", id=item.message.id, result=item.message.params)
            await writes.send(SessionMessage(answer))

asyncio.run(stdio.serve(Echo(), lambda: os._exit({_GONE})))
"""


def message(number: int, method: str = "echo", text: str = "") -> bytes:
    whole = {"jsonrpc": "2.0", "id": number, "method": method, "params": {"text": text}}
    return json.dumps(whole).encode() + b"\n"


class Echo:
    def __init__(self, process: subprocess.Popen[bytes]) -> None:
        self.process = process

    def send(self, data: bytes) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(data)
        self.process.stdin.flush()

    def answer(self) -> dict[str, object]:
        assert self.process.stdout is not None
        answer: dict[str, object] = json.loads(self.process.stdout.readline())
        return answer

    def most_memory(self) -> int:
        """Return the most that it ever had, in kB."""
        with open(f"/proc/{self.process.pid}/status") as status:
            return next(int(line.split()[1]) for line in status if line.startswith("VmHWM"))


@contextmanager
def echo(*, blocking: bool = True) -> Iterator[Echo]:
    theirs, reads = os.pipe()
    writes, ours = os.pipe()
    for end in (theirs, ours):
        os.set_blocking(end, blocking)
    process = forked.Popen(
        [sys.executable, "-c", _ECHO], stdin=theirs, stdout=ours, stderr=subprocess.PIPE
    )
    os.close(theirs)
    os.close(ours)
    process.stdin, process.stdout = os.fdopen(reads, "wb"), os.fdopen(writes, "rb")
    alarm = threading.Timer(PATIENCE, process.kill)
    alarm.start()
    try:
        yield Echo(process)
    finally:
        alarm.cancel()
        process.kill()
        process.wait()
        for pipe in (process.stdin, process.stdout, process.stderr):
            assert pipe is not None
            pipe.close()


@pytest.mark.parametrize("hanging", [False, True])
@pytest.mark.parametrize("closed", ["stdin", "stdout"])
@pytest.mark.every
def test_a_host_that_is_gone_is_noticed_even_if_the_event_loop_hangs(
    closed: str, hanging: bool
) -> None:
    with echo() as host:
        host.send(message(1))
        host.answer()
        if hanging:
            host.send(message(2, "hang"))
            assert host.process.stderr is not None
            assert host.process.stderr.read(5) == b"hangs"
        getattr(host.process, closed).close()
        assert host.process.wait(PATIENCE) == _GONE


def test_a_long_message_takes_little_memory_and_the_next_one_is_read() -> None:
    with echo() as host:
        host.send(message(1, text="x" * (MOST_BYTES - 200)))
        assert host.answer()["id"] == 1
        before = host.most_memory()
        host.send(message(2, text="x" * 100_000_000))
        told = f"the message is longer than {MOST_BYTES} bytes; nothing was done"
        assert host.answer()["error"] == {"code": -32700, "message": told}
        assert host.most_memory() < before + 30_000
        host.send(b"\n" + message(3))
        assert host.answer()["id"] == 3


def test_an_id_that_is_used_again_while_its_request_runs() -> None:
    with echo() as host:
        for _ in range(2):  # again after its answer: the SDK takes that
            host.send(message(1))
            assert "result" in host.answer()
        host.send(message(1, "wait") + message(1))
        refused = host.answer()
        assert refused["id"] == 1
        assert refused["error"] == {"code": -32600, "message": RUNS_ALREADY[1]}
        host.send(message(1).replace(b"1,", b'"1",'))  # the same to the SDK
        assert "error" in host.answer()
        cancelled = {"method": "notifications/cancelled", "params": {"requestId": 1}}
        host.send(json.dumps({"jsonrpc": "2.0", **cancelled}).encode() + b"\n" + message(1))
        assert "result" in host.answer()


def test_pipes_that_do_not_block() -> None:
    with echo(blocking=False) as host:
        for number in range(3):
            host.send(message(number, text="x" * 1_000_000))
        for number in range(3):
            assert host.answer()["id"] == number


DEEP = b'{"order":' * 10_000


@pytest.mark.parametrize(
    ("line", "found"),
    [
        (b'{"id": 7, "params": {"id": 8, "a": [{}, "}"]}, "method": "x"}', 7),
        (b'{"params": {"a": "\\"}{"}, "id": "seven", "method": 3}', "seven"),
        (b'{"jsonrpc":"2.0","id":90,"method":"tools/call","params":' + DEEP, 90),
        (b'{"jsonrpc":"2.0","method":"tools/call","params":' + DEEP + b'"id":90}', None),
        (b'{"id": 12', None),  # perhaps the half of 1234
        (b'{"id": true, "method": "x"}', None),
        (b'{"id": {"id": 1}, "method": "x"}', None),
        (b'{"params": {"id": 1, "a": 2}, "id": 3}', None),  # no request
        (b'{"id": 3, "result": "\\ud83d"}', None),
        (b'{"method": "tools/call", "params": {"a": "\\ud83d"}, "jsonrpc": "2.0", "id": 5}', 5),
        (b"[" * 10_000, None),
        (b"[1, 2]", None),
        (b"", None),
        (b"}{,", None),
    ],
)
def test_whose_request_it_was(line: bytes, found: object) -> None:
    assert request_id(line) == found

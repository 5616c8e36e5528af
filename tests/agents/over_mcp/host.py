"""A host that speaks the protocol by hand: it can stop reading, and send what no client would."""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import threading
from typing import IO, Any

from tests import forked
from tests.agents.over_mcp.lab import PATIENCE, Robot, Serving

_HELLO = {
    "protocolVersion": "2025-11-25",
    "capabilities": {},
    "clientInfo": {"name": "test", "version": "0"},
}


class Host:
    """Starts `actionkit mcp` as hosts do, with the six variables that they pass on and one more."""

    def __init__(self, robot: Robot, *, before: str = "", **environment: str) -> None:
        passed = {
            name: value
            for name in ("HOME", "LOGNAME", "PATH", "SHELL", "TERM", "USER")
            if (value := os.environ.get(name)) is not None
        }
        self.errors = robot.file.with_name(f"host-{id(self)}.txt")
        self._stderr: IO[bytes] = self.errors.open("wb")
        self.process = forked.Popen(
            robot.words(before=before),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._stderr,
            env=passed | {"ACTIONKIT_LEDGER": str(robot.ledger)} | environment,
            start_new_session=True,
        )
        self.serving = Serving(self.process.pid)
        self.lines: list[str] = []
        """All that came from standard output."""
        self._id = 0

    def __enter__(self) -> Host:
        self.ask("initialize", _HELLO)
        self.send({"method": "notifications/initialized"})
        return self

    def __exit__(self, *_: object) -> None:
        self.serving.close()
        self.process.wait()
        for pipe in (self.process.stdin, self.process.stdout, self._stderr):
            assert pipe is not None
            with contextlib.suppress(BrokenPipeError):
                pipe.close()

    def send(self, message: dict[str, Any]) -> None:
        self.send_line(json.dumps({"jsonrpc": "2.0", **message}))

    def send_line(self, line: str) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(line.encode() + b"\n")
        self.process.stdin.flush()

    def begin(self, method: str, params: dict[str, Any]) -> int:
        """Send a request; return its id."""
        self._id += 1
        self.send({"id": self._id, "method": method, "params": params})
        return self._id

    def call(self, tool: str, **arguments: Any) -> int:
        return self.begin("tools/call", {"name": tool, "arguments": arguments})

    def answer(self, number: int) -> dict[str, Any]:
        """Read until the answer to a request."""
        assert self.process.stdout is not None
        alarm = threading.Timer(PATIENCE, self.process.kill)
        alarm.start()
        try:
            for line in self.process.stdout:
                self.lines.append(line.decode())
                message: dict[str, Any] = json.loads(line)
                if message.get("id") == number and "method" not in message:
                    return message
        finally:
            alarm.cancel()
        raise AssertionError(f"ended without an answer:\n{self.errors.read_text()}")

    def ask(self, method: str, params: dict[str, Any]) -> dict[str, Any]:
        return self.answer(self.begin(method, params))

    def hang_up(self) -> None:
        assert self.process.stdin is not None
        self.process.stdin.close()

    def code(self) -> int:
        return self.process.wait(PATIENCE)

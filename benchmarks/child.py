"""A process that does what it is told: one JSON object per line, there and back."""

from __future__ import annotations

import json
import os
import select
import subprocess
import sys
import time
import traceback
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import IO, Any

from typing_extensions import Self

_PATIENCE = 600.0
_LEAVING = 20.0
_ELSEWHERE = ("ROS_LOCALHOST_ONLY", "ROS_STATIC_PEERS")
"""Variables that would overrule the range of discovery."""


class Child:
    """The parent's side. A context manager, which ends the process."""

    def __init__(self, domain: int, module: str, *arguments: str) -> None:
        """Start `python -m module arguments` in a ROS domain, on this machine only."""
        self._process = subprocess.Popen(
            [sys.executable, "-m", module, *arguments],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            bufsize=1,
            env=environment(domain),
        )
        self._name = " ".join([module, *arguments])
        self.pid = self._process.pid
        self.patience = _PATIENCE

    def do(self, command: str, **arguments: Any) -> Any:
        """Carry out one command and return what it returns.

        Raises:
            RuntimeError: It failed there, the process ended, or nothing came for `patience`
                seconds; it is not asked again then, but killed.
        """
        self.begin(command, **arguments)
        return self.end()

    def begin(self, command: str, **arguments: Any) -> None:
        """Send a command; `end` waits for its answer.

        Raises:
            RuntimeError: The process has ended.
        """
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(json.dumps({"do": command, **arguments}) + "\n")
            self._process.stdin.flush()
        except BrokenPipeError:
            raise RuntimeError(f"{self._name} has ended") from None

    def end(self) -> Any:
        """Return what the command of `begin` returns."""
        assert self._process.stdout is not None
        ready, _, _ = select.select([self._process.stdout], [], [], self.patience)
        line = self._process.stdout.readline() if ready else ""
        if not line:
            self._process.kill()
            raise RuntimeError(f"no answer from {self._name} in {self.patience:.0f} s")
        answer = json.loads(line)
        if "error" in answer:
            raise RuntimeError(f"{self._name} failed:\n{answer['error']}")
        return answer["ok"]

    def kill(self) -> None:
        """End it at once: it has something to do that nobody waits for any more."""
        self._process.kill()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        with suppress(BrokenPipeError):  # it has ended, with something unread
            self._process.stdin.close()
        try:
            self._process.wait(_LEAVING)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._process.stdout.close()


def run(domain: int, module: str, *arguments: str) -> str:
    """Run `python -m module arguments` in a ROS domain; return what it prints."""
    return subprocess.run(
        [sys.executable, "-m", module, *arguments],
        stdout=subprocess.PIPE,
        text=True,
        env=environment(domain),
        timeout=_PATIENCE,
        check=True,
    ).stdout


def seconds_until(text: str, domain: int, *command: str) -> float:
    """Run Python with these arguments in a ROS domain, until it has printed a line with `text`.

    Raises:
        RuntimeError: It has not, or has failed.
    """
    began = time.perf_counter()
    process = subprocess.Popen(
        [sys.executable, *command],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        env=environment(domain),
    )
    try:
        assert process.stdout is not None
        line = next((line for line in process.stdout if text in line), "")
        took = time.perf_counter() - began
        process.communicate(timeout=_PATIENCE)
    finally:
        process.kill()
    if not line or process.returncode:
        raise RuntimeError(f"{command} ended with code {process.returncode}")
    return took


def environment(domain: int) -> dict[str, str]:
    """Return the variables of a process in a ROS domain, on this machine only."""
    environment = {k: v for k, v in os.environ.items() if k not in _ELSEWHERE}
    return {
        **environment,
        "ROS_DOMAIN_ID": str(domain),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
    }


def claim_stdout() -> IO[str]:
    """Keep stdout for answers: whatever a library prints goes to stderr. First thing in a child."""
    answers = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)
    return answers


def serve(answers: IO[str], commands: Mapping[str, Callable[..., Any]]) -> None:
    """The child's side: obey until stdin ends."""
    for line in sys.stdin:
        arguments = json.loads(line)
        try:
            answer = {"ok": commands[arguments.pop("do")](**arguments)}
        except Exception:  # noqa: BLE001  told to the parent
            answer = {"error": traceback.format_exc()}
        answers.write(json.dumps(answer) + "\n")

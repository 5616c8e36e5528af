"""Clients for fault tests: one in this process, one in another process."""

from __future__ import annotations

import itertools
import json
import os
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

from actionkit import Client, GoalFuture, Timeouts
from actionkit.testing import EventLog
from tests import forked
from tests.conftest import without_noise
from tests.faults.lab import POLICIES, TIMEOUTS, Seen, budget

_ROOT = Path(__file__).parents[2]

_LAST_ANSWERS = 4.0
"""Seconds in which a closed client that has nothing to watch has been told so."""


class LocalCaller:
    """A client in this process."""

    def __init__(
        self,
        timeouts: Timeouts = TIMEOUTS,
        on_event: Callable[[str, str, Any], None] = lambda key, event, details: None,
    ) -> None:
        """Make the client.

        Args:
            timeouts: Its.
            on_event: Told, on any thread, of each first feedback and of each end, by key.
        """
        from test_msgs.action import Fibonacci

        self.client = Client(Fibonacci, "fibonacci", timeouts=timeouts, retry_budget=budget())
        self._on_event = on_event
        self._futures: dict[str, GoalFuture[Any, Any]] = {}
        self._feedback: dict[str, EventLog[Any]] = {}

    def call(self, key: str, policy: str, timeout: float | None = None) -> None:
        log = self._feedback[key] = EventLog()

        def on_feedback(message: Any) -> None:
            log(message)
            if len(log) == 1:
                self._on_event(key, "feedback", None)

        future = self._futures[key] = self.client.call_async(
            {"order": 5}, on_feedback, timeout, retry=POLICIES[policy]
        )
        future.add_done_callback(
            lambda _: self._on_event(key, "end", Seen.of(future.outcome(0)).__dict__)
        )

    def cancel(self, key: str) -> None:
        self._futures[key].cancel()

    def wait_for_feedback(self, key: str) -> None:
        self._feedback[key].wait_for(1)

    def seen(self, key: str, timeout: float) -> Seen:
        return Seen.of(self._futures[key].outcome(timeout))

    def close(self) -> bool:
        self.client.close()
        # What a server has done is on its way as an answer; a lost one is asked for within 2 s.
        return not self.client._session.connection.freed.wait(_LAST_ANSWERS)


class RemoteCaller:
    """A client in a process of its own, which is told what to do by lines of JSON."""

    def __init__(self, timeouts: Timeouts = TIMEOUTS) -> None:
        """Start the process; where it is, is up to the thread that this is called on."""
        self._process = forked.Popen(
            [sys.executable, "-m", "tests.faults.remote_client", json.dumps(timeouts.__dict__)],
            cwd=_ROOT,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            bufsize=1,
            env={**os.environ, "PYTHONUNBUFFERED": "1", "PYTHONPATH": str(_ROOT)},
        )
        self._numbers = itertools.count()
        self._log: EventLog[dict[str, Any]] = EventLog()
        self._reader = threading.Thread(target=self._read, daemon=True, name="remote client")
        self._reader.start()
        self._log.wait_for(1, timeout=30)  # that it is up

    def call(self, key: str, policy: str, timeout: float | None = None) -> None:
        self._tell(do="call", key=key, policy=policy, timeout=timeout)

    def cancel(self, key: str) -> None:
        self._tell(do="cancel", key=key)

    def wait_for_server(self, timeout: float) -> bool:
        """As `Client.wait_for_server`."""
        key = f"question {next(self._numbers)}"
        self._tell(do="wait_for_server", key=key, timeout=timeout)
        return bool(self._entry(key, "server", timeout + 5)["details"])

    def wait_for_feedback(self, key: str) -> None:
        self._entry(key, "feedback", 10)

    def seen(self, key: str, timeout: float) -> Seen:
        return Seen(**self._entry(key, "end", timeout)["details"])

    def close(self) -> bool:
        self._tell(do="close")
        watches: bool = self._entry("client", "closed", 10)["details"]
        assert self._process.wait(10) == 0
        return watches

    def kill(self) -> None:
        """End the process in any state."""
        if self._process.poll() is None:
            self._process.kill()
        self._process.wait(10)
        self._reader.join(5)
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                pipe.close()

    def _entry(self, key: str, event: str, timeout: float) -> dict[str, Any]:
        return self._log.wait_for(lambda e: e["key"] == key and e["event"] == event, timeout)

    def _tell(self, **command: Any) -> None:
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps(command) + "\n")

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            if without_noise(line):
                self._log(json.loads(line))

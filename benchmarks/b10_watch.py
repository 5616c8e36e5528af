"""10: what `actionkit watch` costs a robot with many actions, and whether it misses anything."""

from __future__ import annotations

import json
import os
import pty
import subprocess
import sys
import threading
import time
from collections import defaultdict
from contextlib import ExitStack, suppress
from pathlib import Path
from tempfile import TemporaryDirectory

from test_msgs.action import Fibonacci

from actionkit import Client
from actionkit.testing import isolated_domain
from benchmarks import process
from benchmarks.child import Child, environment
from benchmarks.measure import Figure, Report, Scale, Verdict

_ACTIONS = 40
_SERVERS = 2
_AT_MOST = 3.0
"""Per cent of a core."""
_WAYS = {"--json": ("--json",), "a table": (), "a table, --feedback": ("--feedback",)}
_STATES = {"ACCEPTED", "EXECUTING", "SUCCEEDED"}
_SETTLED = 8.0
"""Seconds for discovery, and for what is done once."""


def run_all(scale: Scale) -> Report:
    """Measure the CPU of a watch of all actions, and count the states that it misses."""
    report = Report(10, f"A watch of {_ACTIONS} actions")
    with ExitStack() as stack:
        domain = stack.enter_context(isolated_domain())
        os.environ.update(environment(domain))
        names = [f"action_{number}" for number in range(_ACTIONS)]
        for number in range(_SERVERS):
            server = stack.enter_context(Child(domain, "benchmarks.server"))
            server.do("leave")
            for name in names[number::_SERVERS]:
                server.do("renew", name=name)
        clients = [stack.enter_context(Client(Fibonacci, name)) for name in names]
        for client in clients:
            assert client.wait_for_server(60)
        for way, options in _WAYS.items():
            cpu, _, _ = _watched(clients, options, 1.0, scale.pick(10, 25))
            report.figures.append(Figure("CPU at 1 goal a second", way, cpu, "% of a core"))
            report.verdicts.append(Verdict(f"CPU with {way}", cpu, _AT_MOST, "%"))
        cpu, text, sent = _watched(clients, ("--json",), 100.0, scale.pick(5, 25))
        report.figures.append(Figure("CPU at 100 goals a second", "--json", cpu, "% of a core"))
        seen: dict[str, set[str]] = defaultdict(set)
        for line in map(json.loads, text.splitlines()):
            seen[line.get("goal_id", "")].add(line.get("state", ""))
        missed = sum(len(_STATES - seen[goal_id]) for goal_id in sent)
        report.figures.append(Figure("goals at that rate", "--json", len(sent), ""))
        report.verdicts.append(Verdict("states missed at that rate", missed, 0.0, ""))
    return report


def _watched(
    clients: list[Client[Fibonacci]], options: tuple[str, ...], rate: float, seconds: float
) -> tuple[float, str, list[str]]:
    """Send goals under a watch; return its CPU, what it wrote, and the ids of the goals."""
    command = [sys.executable, "-m", "actionkit", "watch", *options]
    with TemporaryDirectory() as folder, (Path(folder) / "out").open("w+") as out:
        master, terminal = pty.openpty()
        shown = out if "--json" in options else terminal
        watch = subprocess.Popen(command, stdin=terminal, stdout=shown, stderr=subprocess.DEVNULL)
        os.close(terminal)
        threading.Thread(target=_discard, args=[master], daemon=True).start()
        time.sleep(_SETTLED)
        before, began = process.cpu(watch.pid), time.monotonic()
        futures = []
        while (now := time.monotonic()) < began + seconds:
            client = clients[len(futures) % len(clients)]
            futures.append(client.call_async({"order": 1}, timeout=60.0))
            time.sleep(max(0.0, began + len(futures) / rate - now))
        sent = [str(future.goal_id) for future in futures if future.outcome(60.0).ok]
        cpu = 100 * (process.cpu(watch.pid) - before) / (time.monotonic() - began)
        time.sleep(1.0)
        watch.terminate()
        watch.wait()
        return cpu, Path(folder, "out").read_text(), sent


def _discard(terminal: int) -> None:
    with suppress(OSError):  # how Linux tells that the last user left
        while os.read(terminal, 65536):
            pass
    os.close(terminal)

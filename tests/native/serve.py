"""The program of a server in C++; its words are those of `python -m actionkit.servers`."""

from __future__ import annotations

import argparse
import ctypes
import json
import os
import signal
import sys
import threading
from typing import IO, Any

import rclpy  # noqa: F401  its libraries are those that rclcpp needs

from actionkit.servers._behaviours.registry import behaviour_named
from actionkit.servers._life import INSTANCE_VARIABLE
from tests.native.build import library, prefix

KINDS = frozenset(
    (
        *("aborts", "blocking", "cancels_itself", "countdown", "crashes", "expires", "fibonacci"),
        *("ignores_cancel", "never_finishes", "preemptive", "queued", "refuses_cancel", "silent"),
        *("slow_accept", "slow_cancel"),
    )
)
"""The reference servers that there are in C++. Their options are those of Python's."""
_NUMBERS = ("period", "delay", "result_timeout")
_WHOLE = ("max_order", "gate", "feedback")
_USUAL = {"delay": 0.0, "max_order": 10_000, "gate": 0, "feedback": 1}


class Options(ctypes.Structure):
    """The struct of the same name in `server.cpp`."""

    _fields_ = (
        ("kind", ctypes.c_char_p),
        ("point", ctypes.c_char_p),
        *((name, ctypes.c_double) for name in _NUMBERS),
        *((name, ctypes.c_int) for name in (*_WHOLE, "write_feedback", "journal")),
    )


def main() -> None:
    """Serve until SIGINT, SIGTERM, or the end of standard input."""
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM})
    parser = argparse.ArgumentParser()
    parser.add_argument("name", choices=sorted(KINDS))
    parser.add_argument("--action", required=True)
    parser.add_argument("--type", choices=["test_msgs/action/Fibonacci"])
    parser.add_argument("--option", action="append", default=[])
    given = parser.parse_args()
    pairs = dict(text.split("=", 1) for text in given.option)
    values: dict[str, Any] = {"period": 0.0, **_USUAL, **behaviour_named(given.name).parse(pairs)}

    stdout = os.dup(1)
    os.dup2(2, 1)
    for file in ("librclcpp.so", "librclcpp_action.so"):
        ctypes.CDLL(str(prefix() / "lib" / file), ctypes.RTLD_GLOBAL)
    native = ctypes.CDLL(str(library()))
    native.start.restype = ctypes.c_void_p
    options = Options(
        kind=given.name.encode(),
        point=str(values.get("point", "")).encode(),
        **{name: values[name] for name in (*_NUMBERS, *_WHOLE)},
        write_feedback=values["journal"] == "all",
        journal=stdout,
    )
    # The same after a restart, as for a real server.
    name = f"reference_server_{os.environ.get(INSTANCE_VARIABLE, os.getpid())}".encode()
    server = ctypes.c_void_p(native.start(name, given.action.encode(), ctypes.byref(options)))
    ready = {"event": "ready", "goal_id": None, "monotonic": 0.0, "server": given.name}
    os.write(stdout, json.dumps(ready).encode() + b"\n")
    commands = sys.stdin.buffer
    threading.Thread(target=_obey, args=(commands, native, server), daemon=True).start()
    signal.sigwait({signal.SIGINT, signal.SIGTERM})
    native.stop(server)
    os._exit(0)


def _obey(commands: IO[bytes], native: ctypes.CDLL, server: ctypes.c_void_p) -> None:
    for line in commands:
        command = json.loads(line)
        match command["command"]:
            case "release":
                count = command["n"]
                native.release(server, -1 if count is None else count)
            case "hold":
                native.hold(server)
            case "sync":
                native.synced(server, command["n"])
    os.kill(os.getpid(), signal.SIGTERM)


if __name__ == "__main__":
    main()

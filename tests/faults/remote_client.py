"""The process of a `RemoteCaller`: a client that gets commands and answers as lines of JSON."""

from __future__ import annotations

import json
import sys
import threading
from typing import Any

from actionkit import Timeouts
from tests.faults.callers import LocalCaller

_lock = threading.Lock()


def tell(key: str, event: str, details: Any) -> None:
    """Write a line."""
    with _lock:
        print(json.dumps({"key": key, "event": event, "details": details}), flush=True)


def main() -> None:
    """Obey until told to close, or until nobody is left who could tell."""
    caller = LocalCaller(Timeouts(**json.loads(sys.argv[1])), tell)
    tell("client", "up", None)
    for line in sys.stdin:
        command = json.loads(line)
        what = command.pop("do")
        if what == "call":
            caller.call(**command)
        elif what == "cancel":
            caller.cancel(**command)
        elif what == "wait_for_server":
            tell(command["key"], "server", caller.client.wait_for_server(command["timeout"]))
        elif what == "close":
            tell("client", "closed", caller.close())
            return
        else:
            raise ValueError(f"cannot {what}")


if __name__ == "__main__":
    main()

"""Shared by tests of holds: the processes that keep them, and an agent in its own process."""

from __future__ import annotations

import asyncio
import os
import signal
from contextlib import suppress
from pathlib import Path

from actionkit.agents._tool_calls.hold import HoldListener


def known(listener: HoldListener, seconds: float) -> bool:
    """Wait until a listener knows whether there is a hold; return whether it does."""
    return asyncio.run(listener.until_known(seconds))


def keepers(domain: int) -> list[int]:
    """Return the processes that keep holds in a ROS domain."""
    found = []
    for process in Path("/proc").iterdir():
        if process.name.isdigit():
            with suppress(OSError):
                words = (process / "cmdline").read_bytes().split(b"\0")
                variables = (process / "environ").read_bytes().split(b"\0")
                ended = b"\nState:\tZ" in (process / "status").read_bytes()
                ours = f"ROS_DOMAIN_ID={domain}".encode() in variables
                if b"actionkit.cli.cancel_and_stop._keeper" in words and ours and not ended:
                    found.append(int(process.name))
    return found


def end_keepers(domain: int) -> None:
    """Kill what a test has left."""
    for pid in keepers(domain):
        with suppress(OSError):
            os.kill(pid, signal.SIGKILL)


AGENT = """
import asyncio
import sys
from actionkit.agents._tool_calls.hold import HoldListener
listener = HoldListener()
print("known", asyncio.run(listener.until_known(30)), flush=True)
for line in sys.stdin:
    wait = line.strip()
    if wait == "now":
        print(listener.why_held() or "FREE", flush=True)
    elif wait == "known":
        print(asyncio.run(listener.until_known(30)), flush=True)
listener.close()
"""
"""Prints why it is held, whenever it is asked."""

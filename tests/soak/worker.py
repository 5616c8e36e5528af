"""The process of the soak that makes calls in all rounds, until the soak ends.

It obeys lines of JSON: {"seconds": 20, "seed": 1, "records": PATH} is a round, which it answers
with a line that says what has grown. The end of its input ends it. On SIGUSR1 it writes the
stacks of all threads to its standard error, where its log goes, too.
"""

from __future__ import annotations

import asyncio
import faulthandler
import gc
import json
import logging
import os
import random
import signal
import sys
import threading
import time
from pathlib import Path
from typing import Any

from benchmarks.process import resident
from tests.soak import records
from tests.soak.caller import Caller

_THREADS = 3
_TASKS = 2


def work(caller: Caller, seed: int, until: float) -> None:
    """Make calls until the time is up."""
    chance = random.Random(seed)
    while time.monotonic() < until:
        caller.one_of_many(chance)


def work_with_tasks(caller: Caller, seed: int, until: float) -> None:
    """The same, in tasks of a loop of its own."""

    async def task(number: int) -> None:
        chance = random.Random(seed + number)
        while time.monotonic() < until:
            await caller.awaited(chance)

    async def main() -> None:
        await asyncio.gather(*(task(number) for number in range(_TASKS)))

    asyncio.run(main())


def call_for(caller: Caller, seconds: float, seed: int) -> None:
    """One round of calls; returns when all of them have ended."""
    until = time.monotonic() + seconds
    threads = [
        threading.Thread(target=work, args=(caller, seed + number, until), daemon=True)
        for number in range(1, _THREADS + 1)
    ]
    threads.append(
        threading.Thread(target=work_with_tasks, args=(caller, seed + 1000, until), daemon=True)
    )
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()


def state(caller: Caller) -> dict[str, Any]:
    """What must not grow from round to round."""
    gc.collect()
    tables: dict[str, int] = {}
    for client in caller.clients.values():
        for name, size in client._session.connection.table_sizes().items():
            tables[name] = tables.get(name, 0) + size
    timers = tables.pop("timers", 0)  # some of them are always there
    return {
        "memory": resident(os.getpid()),
        "tables": {name: size for name, size in tables.items() if size},
        "timers": timers,
        "threads": threading.active_count(),
        "pending": sum(client.pending for client in caller.clients.values()),
    }


def main() -> None:
    faulthandler.register(signal.SIGUSR1, all_threads=True)
    logging.basicConfig(level=logging.WARNING)
    caller = Caller()
    print(json.dumps({"up": True}), flush=True)
    for line in sys.stdin:
        command = json.loads(line)
        if command.get("state"):
            print(json.dumps(state(caller)), flush=True)
            continue
        call_for(caller, command["seconds"], command["seed"])
        records.write(Path(command["records"]), caller.take_records())
        print(json.dumps({"done": True}), flush=True)
    caller.close()


if __name__ == "__main__":
    main()

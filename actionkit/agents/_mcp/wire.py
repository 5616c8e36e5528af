"""Standard input and output, taken away from everything else in the process.

Imports nothing heavy: the wire is taken before libraries, which may print, are imported. All that
is written to standard output afterwards, in Python or in C, goes to standard error.
"""

from __future__ import annotations

import asyncio
import contextlib
import fcntl
import io
import os
import queue
import select
import stat
import sys
import threading
from collections.abc import Callable

MOST_BYTES = 4 * 1024 * 1024
"""The longest line that is read, as for the body of an HTTP request."""
_CHUNK = 64 * 1024
_LINES_AHEAD = 16


class Line(bytes):
    """A line from the host."""


class TooLong(bytes):
    """The beginning of a line that is longer than `MOST_BYTES`."""


class Wire:
    """The host's end of the two pipes. One thread reads, one writes; neither holds up an exit."""

    def __init__(self) -> None:
        """Take descriptors 0 and 1.

        Raises:
            OSError: One of them is closed.
        """
        self._reads = fcntl.fcntl(0, fcntl.F_DUPFD_CLOEXEC, 3)
        self._writes = fcntl.fcntl(1, fcntl.F_DUPFD_CLOEXEC, 3)
        nothing = os.open(os.devnull, os.O_RDWR)
        os.dup2(nothing, 0)
        try:
            os.dup2(2, 1)
        except OSError:  # standard error is closed
            os.dup2(nothing, 1)
        os.close(nothing)
        if isinstance(sys.stdout, io.TextIOWrapper):
            sys.stdout.reconfigure(line_buffering=True)  # as it is where people read it
        self._outgoing: queue.SimpleQueue[tuple[bytes, Callable[[], object]]] = queue.SimpleQueue()
        self._incoming: asyncio.Queue[bytes]
        self._loop: asyncio.AbstractEventLoop
        self._gone: Callable[[], object]

    @property
    def is_terminal(self) -> bool:
        """Whether a person types here, rather than a host."""
        return os.isatty(self._reads)

    def open(self, gone: Callable[[], object]) -> None:
        """Begin to read and write, on the running event loop.

        Args:
            gone: Called, from a thread, when the host has closed its end of either pipe.
        """
        self._loop = asyncio.get_running_loop()
        self._incoming = asyncio.Queue(_LINES_AHEAD)
        self._gone = gone
        for target in (self._read, self._write):
            name = f"mcp-{target.__name__.strip('_')}"
            threading.Thread(target=target, name=name, daemon=True).start()

    async def line(self) -> bytes:
        """Return the next `Line`, or `TooLong`; `b""` when the host has closed its end."""
        return await self._incoming.get()

    async def write(self, data: bytes) -> None:
        """Write, and return when it is written; cancelling gives up the waiting alone."""
        written: asyncio.Future[None] = self._loop.create_future()

        def settle() -> None:
            if not written.done():
                written.set_result(None)

        def tell() -> None:
            with contextlib.suppress(RuntimeError):  # the loop has ended
                self._loop.call_soon_threadsafe(settle)

        self._outgoing.put((data, tell))
        await written

    async def flush(self) -> None:
        """Return when everything that was given to `write` is written."""
        await self.write(b"")

    # -- threads ---------------------------------------------------------------------------

    def _read(self) -> None:
        poll = select.poll()
        poll.register(self._reads, select.POLLIN)
        mode = os.fstat(self._writes).st_mode
        if stat.S_ISFIFO(mode) or stat.S_ISSOCK(mode):
            # A host that was killed may have left its end of our input to a child of its own.
            poll.register(self._writes, 0)  # errors are always reported
        rest, skipping = bytearray(), False
        while True:
            ready = dict(poll.poll())
            if self._writes in ready:
                break
            try:
                data = os.read(self._reads, _CHUNK)
            except OSError:
                break
            if not data:
                break
            *lines, last = data.split(b"\n")
            for line in lines:
                rest += line
                if not skipping:
                    self._put(Line(rest) if len(rest) <= MOST_BYTES else TooLong(rest[:MOST_BYTES]))
                rest, skipping = bytearray(), False
            if not skipping:
                rest += last
            if len(rest) > MOST_BYTES:
                self._put(TooLong(rest[:MOST_BYTES]))
                rest, skipping = bytearray(), True
        self._gone()
        self._put(b"")

    def _put(self, line: bytes) -> None:
        with contextlib.suppress(RuntimeError):  # the loop has ended
            # Waits while there is no room: a host that floods us is held up itself.
            asyncio.run_coroutine_threadsafe(self._incoming.put(line), self._loop).result()

    def _write(self) -> None:
        open_ = True
        while True:
            data, tell = self._outgoing.get()
            view = memoryview(data)
            while view and open_:
                try:
                    view = view[os.write(self._writes, view) :]
                except BlockingIOError:  # somebody has made the pipe so
                    select.select([], [self._writes], [])
                except OSError:
                    open_ = False
                    self._gone()
            tell()


def warn_people() -> None:
    """Tell a person who has started this in a terminal what it waits for."""
    print(
        "Serving MCP on standard input and output, which is for programs: a host starts this"
        " command by itself. `actionkit mcp --help` tells how. Ctrl-C ends it.",
        file=sys.stderr,
    )

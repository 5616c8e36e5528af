"""Writes events as lines of JSON to a file that rotates and survives a crash."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Any

from typing_extensions import Self

from actionkit._messages.convert import to_plain
from actionkit._model.values import GoalEvent, GoalState, Outcome
from actionkit._observers.json_schema import event_line, outcome_line
from actionkit._observers.protocol import CallInfo


class JsonLines:
    """An observer that appends a line of JSON for each event to a file.

        with JsonLines("goals.jsonl") as log, Client(Fibonacci, "fibonacci", observers=[log]):
            ...

    The operating system gets each line at once. So if the process is killed, it loses at most one
    line of the events that have reached this observer. Any number of clients and threads of a
    process may share one observer. `read_json_lines` reads the files back. docs/logging.md
    describes the lines.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        *,
        max_bytes: int | None = 10_000_000,
        backups: int = 5,
        messages: bool = True,
        max_items: int | None = 100,
    ) -> None:
        """Open the file for appending, or make it.

        Args:
            path: The file. Its folder must exist.
            max_bytes: The size at which the file is renamed to `path.1` and a new file begins;
                `None` means never.
            backups: How many renamed files are kept: `path.1`, the newest, to `path.N`.
            messages: Whether goals, feedback and results are written, too.
            max_items: How many elements of each array in a message are written at most; `None`
                means all.

        Raises:
            OSError: The file cannot be written.
            TypeError: An argument has the wrong type.
            ValueError: A number is out of range.
        """
        if not isinstance(path, (str, os.PathLike)):
            raise TypeError(f"JsonLines: path={path!r} must be a string or a path")
        if not isinstance(messages, bool):
            raise TypeError(f"JsonLines: messages={messages!r} must be True or False")
        self.path = Path(os.path.abspath(path))
        bounds = _whole("max_bytes", max_bytes), _whole("backups", backups) or 0
        self._messages = messages
        self._max_items = _whole("max_items", max_items)
        self._file = RotatingFile(self.path, *bounds)

    def __repr__(self) -> str:
        return f"<JsonLines {str(self.path)!r}>"

    def on_event(self, event: GoalEvent, call: CallInfo) -> None:
        """Write a transition. The first line of a call also has the goal."""
        first = event.state is GoalState.SENDING and event.attempt == 1
        self._file.write(event_line(event, call, goal=self._plain(call.goal) if first else None))

    def on_feedback(self, event: GoalEvent, feedback: Any, call: CallInfo) -> None:
        """Write a feedback message."""
        self._file.write(event_line(event, call, feedback=self._plain(feedback)))

    def on_outcome(self, outcome: Outcome[Any], call: CallInfo) -> None:
        """Write the end of a call."""
        self._file.write(outcome_line(outcome, call, self._plain(outcome.result)))

    def close(self) -> None:
        """Close the file. A later event opens it again."""
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        exc_type: type[BaseException] | None,
        exc: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    def _plain(self, message: Any) -> dict[str, Any] | None:
        if message is None or not self._messages:
            return None
        return to_plain(message, max_items=self._max_items)


class RotatingFile:
    """A file that lines are appended to. When it is full it is renamed, and a new one begins."""

    def __init__(self, path: Path, max_bytes: int | None = 10_000_000, backups: int = 5) -> None:
        """Open the file for appending, or make it. The defaults are those of `JsonLines`.

        Raises:
            OSError: The file cannot be written.
        """
        self._path, self._max_bytes, self._backups = path, max_bytes, backups
        self._lock = threading.RLock()  # a signal handler may close what is being closed
        self._file: int | None = None
        self._size = 0
        self._torn = False
        """Whether the file ends in the middle of a line."""
        self._open()

    def close(self) -> None:
        """Close the file. A later line opens it again."""
        with self._lock:
            self._close()

    def __del__(self, close: Callable[[int], None] = os.close) -> None:
        file = getattr(self, "_file", None)  # absent if `__init__` failed
        if file is not None:
            close(file)  # a default argument: at the interpreter's end, modules are gone

    def write(self, line: str) -> None:
        """Write a line, at once."""
        data = line.encode() + b"\n"  # ASCII: all other characters are escaped
        with self._lock:
            if self._file is None:
                self._open()
            if self._max_bytes is not None and 0 < self._size > self._max_bytes - len(data):
                self._rotate()
            self._append(b"\n" + data if self._torn else data)

    def _append(self, data: bytes) -> None:
        assert self._file is not None
        rest = memoryview(data)
        while rest:
            written = os.write(self._file, rest)
            self._size += written
            rest = rest[written:]
            self._torn = bool(rest)  # for the next line, if the disk is full

    def _open(self) -> None:
        flags = os.O_RDWR | os.O_APPEND | os.O_CREAT | os.O_CLOEXEC
        self._file = os.open(self._path, flags, 0o666)
        self._size = os.fstat(self._file).st_size
        # A killed process may have left half a line: the next one must not be joined to it.
        self._torn = self._size > 0 and os.pread(self._file, 1, self._size - 1) != b"\n"

    def _close(self) -> None:
        file, self._file = self._file, None
        if file is not None:
            os.close(file)

    def _rotate(self) -> None:
        self._close()
        if self._backups == 0:
            self._path.unlink(missing_ok=True)
        for number in range(self._backups, 0, -1):
            source = backup(self._path, number - 1)
            if source.exists():
                source.replace(backup(self._path, number))
        self._open()


def backup(path: Path, number: int) -> Path:
    """Return the name of the file that was renamed `number` rotations ago."""
    return path.with_name(f"{path.name}.{number}") if number else path


def _whole(name: str, value: int | None) -> int | None:
    if value is None and name != "backups":
        return None
    if isinstance(value, bool) or not isinstance(value, int):
        raise TypeError(f"JsonLines: {name}={value!r} must be a whole number")
    least = 0 if name == "backups" else 1
    if value < least:
        raise ValueError(f"JsonLines: {name}={value!r} must be {least} or more")
    return value

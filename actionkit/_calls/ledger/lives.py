"""Tells which processes of a ledger are alive, by locks that end with the process.

The kernel drops such a lock however the process ends. It also works between containers that share
the file, where the numbers of processes mean nothing.
"""

from __future__ import annotations

import fcntl
import os
import struct

_FLOCK = "hhqqi"
"""`struct flock` of Linux on 64 bits: type, whence, start, length, pid."""
_SHARED = 0x40000002, 510
"""The bytes that each process with an open SQLite file has locked in it, to read."""
_IN_USE = 128, 1
"""The same in its `-shm` file."""
_SET, _GET = getattr(fcntl, "F_OFD_SETLK", 37), getattr(fcntl, "F_OFD_GETLK", 36)
"""Linux has them; a Python that was built with old headers does not name them."""


class Lives:
    """The locks of this process: the byte of its number in the ledger, and in its `-alive` file.

    Version 1.0 knows only the second, which somebody may remove. A POSIX lock ends when the process
    closes any descriptor of the file, as it does when it copies the folder. So these are locks of
    open file descriptions. SQLite's are POSIX locks, and some of them say that the file is in use.
    Without these, another process removes its `-wal` file, with goals. So this holds them, too.
    """

    def __init__(self, path: str) -> None:
        """Open the files; SQLite has made the first two. Raises OSError."""
        self._own = 0
        self._descriptors: list[int] = []
        try:
            for name, make in ((path, 0), (f"{path}-shm", 0), (f"{path}-alive", os.O_CREAT)):
                flags = os.O_RDWR | os.O_CLOEXEC | make
                self._descriptors.append(os.open(name, flags, 0o666))
            self._file, shared_memory, self._alive = self._descriptors
            self._identity = _identity(os.fstat(self._file))
            _lock(self._file, fcntl.F_RDLCK, *_SHARED)
            _lock(shared_memory, fcntl.F_RDLCK, *_IN_USE)
        except BaseException:  # also Ctrl-C: nobody would close them
            self.close()
            raise

    def close(self) -> None:
        """Close the files: in a forked child, which shares these locks, or if they are not used."""
        while self._descriptors:
            os.close(self._descriptors.pop())

    def is_at(self, path: str) -> bool:
        """Whether the ledger is still the file at the path. Raises OSError."""
        try:
            return _identity(os.stat(path)) == self._identity
        except (FileNotFoundError, NotADirectoryError):
            return False

    def begin(self, number: int) -> bool:
        """Lock the number of this process, from 1; return whether it is free. Raises OSError."""
        try:
            _lock(self._file, fcntl.F_WRLCK, number, 1)
            _lock(self._alive, fcntl.F_WRLCK, number, 1)
        except BlockingIOError:
            return False  # `-alive` has outlived an earlier ledger, and a process of that one
        self._own = number
        return True

    def is_alive(self, number: int) -> bool:
        """Whether the process with this number lives. Raises OSError."""
        files = self._file, self._alive
        return number == self._own or any(_is_locked(file, number) for file in files)


def _identity(file: os.stat_result) -> tuple[int, int, bool]:
    return file.st_dev, file.st_ino, file.st_size > 0  # if it was emptied, SQLite starts a new one


def _lock(descriptor: int, kind: int, start: int, length: int) -> None:
    wanted = struct.pack(_FLOCK, kind, os.SEEK_SET, start, length, 0)
    fcntl.fcntl(descriptor, _SET, wanted)


def _is_locked(descriptor: int, start: int) -> bool:
    wanted = struct.pack(_FLOCK, fcntl.F_WRLCK, os.SEEK_SET, start, 1, 0)
    kind: int = struct.unpack(_FLOCK, fcntl.fcntl(descriptor, _GET, wanted))[0]
    return kind != fcntl.F_UNLCK

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


class Lives:
    """The lock file of a ledger: each process locks the byte of its number.

    These locks belong to the process, so a forked child does not have them. Closing any descriptor
    of the file would drop them all, so there is one for each path, and it stays open.
    """

    def __init__(self, path: str) -> None:
        """Open the file; make it if there is none. Raises OSError."""
        self._descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
        self._own = 0

    def begin(self, number: int) -> None:
        """Lock the number of this process, from 1. Raises OSError."""
        fcntl.lockf(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, number)
        self._own = number

    def is_alive(self, number: int) -> bool:
        """Whether the process with this number lives. Raises OSError."""
        wanted = struct.pack(_FLOCK, fcntl.F_WRLCK, os.SEEK_SET, number, 1, 0)
        found = fcntl.fcntl(self._descriptor, fcntl.F_GETLK, wanted)
        other: int = struct.unpack(_FLOCK, found)[0]
        return number == self._own or other != fcntl.F_UNLCK

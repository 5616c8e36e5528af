"""Finds ROS domains that no other test run on this machine uses at the same time."""

from __future__ import annotations

import fcntl
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_FIRST, _LAST = 1, 101
"""Domains above 101 use ports in Linux's ephemeral range, where any program's connection may use
them. 0 is the default for everybody."""
_COUNT = _LAST - _FIRST + 1


@contextmanager
def isolated_domain() -> Iterator[int]:
    """Reserve a ROS domain, so that no other caller on this machine gets it meanwhile.

    A lock on a file reserves it; the system releases the lock when the process dies. All processes
    take the domains in turn, so a domain that was just released is not used for a while: the
    middleware may still discover its last users.

    Yields:
        The id of the domain, 1 to 101.

    Raises:
        RuntimeError: All domains are taken.
    """
    domain, lock = _claim(_directory())
    try:
        yield domain
    finally:
        os.close(lock)


def _directory() -> Path:
    directory = Path(tempfile.gettempdir()) / f"actionkit-domains-{os.getuid()}"
    directory.mkdir(mode=0o700, exist_ok=True)
    if directory.stat().st_uid != os.getuid():
        raise RuntimeError(f"{directory} belongs to another user")
    return directory


def _claim(directory: Path) -> tuple[int, int]:
    """Return a domain that is free, and the descriptor of its lock."""
    turn = os.open(directory / "turn", os.O_RDWR | os.O_CREAT, 0o600)
    try:
        fcntl.flock(turn, fcntl.LOCK_EX)
        text = os.pread(turn, 16, 0)
        last = int(text) if text.strip().isdigit() else _LAST
        for step in range(_COUNT):
            domain = _FIRST + (last - _FIRST + 1 + step) % _COUNT
            descriptor = os.open(directory / f"{domain}.lock", os.O_RDWR | os.O_CREAT, 0o600)
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                os.close(descriptor)
                continue
            # All of one width, so that a shorter number leaves no digit of the last one.
            os.pwrite(turn, f"{domain:<4}".encode(), 0)
            return domain, descriptor
    finally:
        os.close(turn)
    raise RuntimeError(f"all {_COUNT} ROS domains are in use; their locks are in {directory}")

"""ROS domains that no other test run on this machine uses at the same time."""

from __future__ import annotations

import fcntl
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

# Above 101 the ports of a domain reach into Linux's ephemeral range, where any program's
# connection may sit on them. 0 is everybody's default.
_FIRST, _LAST = 1, 101
_COUNT = _LAST - _FIRST + 1


@contextmanager
def isolated_domain() -> Iterator[int]:
    """A ROS domain id (1 to 101) that no other holder on this machine has meanwhile.

    It is held by a lock on a file, which the system drops when the process dies. Ids are given
    out in turn, over all processes, so one that was just given back rests for a while: its last
    users may not have left the middleware's discovery.

    Raises:
        RuntimeError: All domains are taken.
    """
    directory = _directory()
    lock = _claim(directory)
    try:
        yield lock.domain
    finally:
        os.close(lock.descriptor)


class _Lock:
    def __init__(self, domain: int, descriptor: int) -> None:
        self.domain = domain
        self.descriptor = descriptor


def _directory() -> Path:
    directory = Path(tempfile.gettempdir()) / f"actionkit-domains-{os.getuid()}"
    directory.mkdir(mode=0o700, exist_ok=True)
    if directory.stat().st_uid != os.getuid():
        raise RuntimeError(f"{directory} belongs to another user")
    return directory


def _claim(directory: Path) -> _Lock:
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
            # Of one width, so that a shorter number leaves no digit of the last one.
            os.pwrite(turn, f"{domain:<4}".encode(), 0)
            return _Lock(domain, descriptor)
    finally:
        os.close(turn)
    raise RuntimeError(f"all {_COUNT} ROS domains are in use; their locks are in {directory}")

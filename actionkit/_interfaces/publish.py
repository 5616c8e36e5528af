"""Putting what was built into place in one step, so that there is always a package that works."""

from __future__ import annotations

import contextlib
import ctypes
import errno
import fcntl
import os
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

from actionkit._interfaces.errors import TargetError

_PREFIX = ".actionkit-building-"
_AT_FDCWD, _RENAME_EXCHANGE = -100, 2


@contextlib.contextmanager
def locked(target: Path) -> Iterator[None]:
    """Hold a folder for one build; others wait. Whoever dies with it lets go of it.

    Raises:
        TargetError: The folder cannot be made or written to.
    """
    try:
        target.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=target).close()
        folder = os.open(target, os.O_RDONLY | os.O_DIRECTORY)
    except OSError as error:
        raise TargetError(
            f"{target}: nothing can be written here ({error.strerror}). Choose another folder with"
            " -o, or install into a virtual environment of your own"
        ) from None
    try:
        # The folder itself: no file is left behind. Some network file systems cannot.
        with contextlib.suppress(OSError):
            fcntl.flock(folder, fcntl.LOCK_EX)
        yield
    finally:
        os.close(folder)


@contextlib.contextmanager
def workshop(target: Path) -> Iterator[Path]:
    """Make a folder beside what is to be replaced; those of builds that were killed go.

    Call it with the folder locked.
    """
    for left in target.glob(f"{_PREFIX}*"):
        shutil.rmtree(left, ignore_errors=True)
    path = Path(tempfile.mkdtemp(prefix=_PREFIX, dir=target))
    path.chmod(0o755)
    try:
        yield path
    finally:
        shutil.rmtree(path, ignore_errors=True)


def put(new: Path, place: Path) -> None:
    """Replace a folder by another one on the same file system; nobody finds none in between.

    Raises:
        TargetError: It cannot be replaced.
    """
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
        if not place.exists():
            new.rename(place)
        elif not _exchange(new, place):
            # A file system that cannot exchange two folders: there is none for a moment.
            old = new.with_name(f"{new.name}.old")
            place.rename(old)
            new.rename(place)
    except OSError as error:
        raise TargetError(f"{place}: cannot be replaced ({error.strerror})") from error


def _exchange(one: Path, other: Path) -> bool:
    renameat2 = getattr(ctypes.CDLL(None, use_errno=True), "renameat2", None)
    if renameat2 is None:
        return False
    paths = os.fsencode(one), os.fsencode(other)
    if renameat2(_AT_FDCWD, paths[0], _AT_FDCWD, paths[1], _RENAME_EXCHANGE) == 0:
        return True
    number = ctypes.get_errno()
    if number in (errno.EINVAL, errno.ENOSYS, errno.EXDEV):
        return False
    raise OSError(number, os.strerror(number))

"""Unpacks the sources of the field's servers, and keeps what is built from them."""

from __future__ import annotations

import fcntl
import hashlib
import os
import shutil
import tarfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path

TOP = Path(__file__).parents[2]
FIELD = Path(os.environ.get("ACTIONKIT_FIELD_SOURCES") or TOP.parent / "shared" / "field")
"""Where the project keeps the sources of other projects' servers."""
SERVERS = FIELD / "servers"
"""Small servers on top of them. `upstream()` says so where there are none."""
_CACHE = Path(os.environ.get("ACTIONKIT_FIELD") or Path.home() / ".cache" / "actionkit-field")
"""Where they are unpacked and built. It is outside of the checkout, and kept."""


class Missing(Exception):
    """Something that a server needs is not on this machine; the text says what."""


_missing: dict[str, Missing] = {}
"""What could not be built by this process, by name: it does not try again."""


def need(*programs: str) -> None:
    """Raise `Missing` if one of these programs is not installed."""
    for program in programs:
        if shutil.which(program) is None:
            raise Missing(f"there is no {program}")


def upstream() -> Path:
    """Return the folder with the sources; unpack them where they are not."""
    archive = FIELD / "upstream.tar.xz"
    if not archive.exists():
        raise Missing(f"there are no sources of servers in {FIELD}")
    return built("src", lambda folder: _unpack(archive, folder), archive)


def built(name: str, make: Callable[[Path], None], *sources: Path) -> Path:
    """Return a folder that `make` has filled, once for all processes.

    Args:
        name: The folder's.
        make: Fills the folder that it is given, which is empty. It raises `Missing` if something
            that it needs is not there, and any other error if the work fails.
        sources: Files. If one changes, the folder is made again.

    Raises:
        Missing: See `make`.
    """
    if name in _missing:
        raise _missing[name]
    version = hashlib.sha256()
    for source in sources:
        version.update(_digest(source))
    folder = _CACHE / f"{name}-{version.hexdigest()[:12]}"
    ready = folder / "ready"
    if ready.exists():
        return folder
    with _locked(name):  # one process builds, the others wait
        if not ready.exists():
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir(parents=True)
            try:
                make(folder)
            except Missing as missing:
                _missing[name] = missing
                raise
            ready.touch()
    return folder


@cache
def _digest(source: Path) -> bytes:
    if not source.exists():
        raise Missing(f"{source} is not there")
    return hashlib.sha256(source.read_bytes()).digest()


@contextmanager
def _locked(name: str) -> Iterator[None]:
    _CACHE.mkdir(parents=True, exist_ok=True)
    with open(_CACHE / f"{name}.lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def _unpack(archive: Path, folder: Path) -> None:
    with tarfile.open(archive) as files:
        files.extractall(folder, filter="data")

"""Files that tell the processes of one computer of a hold at once, and after all others have ended.

The topic is what counts between computers. Discovery takes up to some seconds, and somebody has to
go on telling; a file needs neither. Each user has a file of its own for each ROS domain, which
everybody on the computer may read.
"""

from __future__ import annotations

import contextlib
import os
import stat
import tempfile
from functools import cache
from pathlib import Path

from actionkit._ros.holds.state import LONGEST, HoldState, decode, encode, merged

_VARIABLE = "ACTIONKIT_HOLD_DIR"
"""Names another directory: tests have one of their own, containers may share one."""
_DIRECTORY = "/tmp/actionkit-holds"
"""Neither `$TMPDIR` nor `$XDG_RUNTIME_DIR`: programs that start agents pass few variables on."""
_FOR_ALL = 0o1777
"""Everybody may write files there, and remove or rename only what is theirs, as in /tmp itself."""


class UnreadableError(OSError):
    """A file cannot be read, so it is not known whether it tells of a hold."""


class HoldFiles:
    """The files of one domain. `read` and `write` may be called from different threads."""

    def __init__(self, domain_id: int) -> None:
        self._prefix = f"domain-{domain_id}-"
        self._own = f"{self._prefix}{_boot()}-{os.getuid()}"
        self._read: tuple[object, HoldState] = (None, HoldState())

    @property
    def directory(self) -> str:
        """Where they are."""
        return os.environ.get(_VARIABLE) or _DIRECTORY

    def read(self) -> HoldState:
        """Return what the files tell. Takes some ten microseconds where nothing has changed.

        Raises:
            UnreadableError: One is there, and cannot be read.
        """
        directory = self.directory
        try:
            with os.scandir(directory) as entries:
                ours = sorted(
                    (entry for entry in entries if self._is_ours(entry)), key=lambda e: e.name
                )
                seen = [(entry.name, entry.stat(follow_symlinks=False)) for entry in ours]
        except FileNotFoundError:
            return HoldState()
        except OSError as error:
            raise UnreadableError(f"{directory}: {error.strerror}") from error
        signature = [(name, info.st_ino, info.st_mtime_ns, info.st_size) for name, info in seen]
        known, state = self._read
        if known != signature:
            state = merged(*(_read(os.path.join(directory, name)) for name, _ in seen))
            self._read = signature, state
        return state

    def _is_ours(self, entry: os.DirEntry[str]) -> bool:
        """Whether it is a file of this domain, since the computer was started, by whom it says."""
        prefix, _, owner = entry.name.rpartition("-")
        if prefix != f"{self._prefix}{_boot()}":
            return False
        info = entry.stat(follow_symlinks=False)
        return stat.S_ISREG(info.st_mode) and owner == str(info.st_uid)

    def write(self, state: HoldState) -> None:
        """Have the own file tell all of `state`, unless it does so already.

        Raises:
            OSError: It cannot be written.
        """
        path = Path(self.directory) / self._own
        with contextlib.suppress(FileNotFoundError, UnreadableError):
            state, old = merged(state, before := _read(str(path))), before
            if state == old:
                return
        if not state:
            return
        _make(path.parent)
        # Renamed at last, so that nobody reads half of it.
        descriptor, temporary = tempfile.mkstemp(prefix=".", dir=path.parent)
        try:
            with open(descriptor, "w", encoding="ascii") as file:
                os.fchmod(descriptor, 0o644)
                file.write(encode(state))
            os.replace(temporary, path)
        except BaseException:  # also Ctrl-C: no half-written file is left
            with contextlib.suppress(OSError):
                os.unlink(temporary)
            raise


def _read(path: str) -> HoldState:
    try:
        with open(os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_CLOEXEC), "rb") as file:
            content = file.read(LONGEST + 1)
    except FileNotFoundError:
        raise
    except OSError as error:
        raise UnreadableError(f"{path}: {error.strerror}") from error
    return decode(content.decode("ascii", "replace"))[0]


def _make(directory: Path) -> None:
    with contextlib.suppress(FileExistsError):
        directory.mkdir()
        directory.chmod(_FOR_ALL)
    if not stat.S_ISDIR(directory.lstat().st_mode):
        raise NotADirectoryError(f"{directory} is no directory")


@cache
def _boot() -> str:
    """Return what differs after each start of the computer: a hold does not outlive that."""
    try:
        return Path("/proc/sys/kernel/random/boot_id").read_text("ascii").strip()[:8]
    except OSError:
        return "0"

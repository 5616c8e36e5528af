"""Keeps holds in files, for the processes of one computer.

Between computers, the topic is used. But the topic needs discovery, which takes up to some seconds,
and a process that goes on publishing. A file needs neither. Each user has one file for each ROS
domain, and everybody on the computer can read it.
"""

from __future__ import annotations

import contextlib
import os
import stat
import tempfile
import uuid
from functools import cache
from pathlib import Path

from actionkit._ros.holds.state import LONGEST, HoldState, decode, encode, merged

_VARIABLE = "ACTIONKIT_HOLD_DIR"
"""Sets another directory, for tests, and for containers that share one."""
_DIRECTORY = "/tmp/actionkit-holds"
"""Not `$TMPDIR` or `$XDG_RUNTIME_DIR`: programs that start agents pass on few variables."""
_FOR_ALL = 0o1777
"""Everybody may write files there, and remove or rename only their own, as in /tmp itself."""


_FIRST_USER_NAMESPACE = 0xEFFFFFFD
"""The inode of the computer's own user namespace: PROC_USER_INIT_INO in Linux."""


class UnreadableError(OSError):
    """A file cannot be read, so nobody knows whether it has a hold."""


class HoldFiles:
    """The files of one domain. `read` and `write` may be called from different threads."""

    def __init__(self, domain_id: int) -> None:
        self._prefix = f"domain-{domain_id}-"
        self._own = f"{self._prefix}{_boot()}-{os.getuid()}{_user_namespace()}"
        self._read: tuple[object, HoldState] = (None, HoldState())

    @property
    def directory(self) -> str:
        """Where they are."""
        return os.environ.get(_VARIABLE) or _DIRECTORY

    def shared_by(self) -> str:
        """Return what only processes have in common that see, and may write, the same files.

        It is letters and digits. If we cannot write files, nobody else has it.
        """
        directory = Path(self.directory)
        try:
            _make(directory)
            info = directory.stat()
            if os.access(directory, os.W_OK):
                return f"{_boot()}_{info.st_dev:x}_{info.st_ino:x}"
        except OSError:
            pass
        return uuid.uuid4().hex

    def read(self) -> HoldState:
        """Return what the files say. Takes some ten microseconds if nothing has changed.

        Raises:
            UnreadableError: A file exists, but cannot be read.
        """
        directory = self.directory
        try:
            if os.path.islink(directory):  # nobody can write there: see `_make`
                raise UnreadableError(f"{directory} is a symbolic link: remove it")
            with os.scandir(directory) as entries:
                ours = sorted(
                    (entry for entry in entries if self._is_ours(entry)), key=lambda e: e.name
                )
                seen = [(entry.name, entry.stat(follow_symlinks=False)) for entry in ours]
        except FileNotFoundError:
            return HoldState()
        except UnreadableError:
            raise
        except OSError as error:
            raise UnreadableError(f"{directory}: {error.strerror}") from error
        signature = [(name, info.st_ino, info.st_mtime_ns, info.st_size) for name, info in seen]
        known, state = self._read
        if known != signature:
            state = merged(*(_read(os.path.join(directory, name)) for name, _ in seen))
            self._read = signature, state
        return state

    def _is_ours(self, entry: os.DirEntry[str]) -> bool:
        """Whether it has the name of a file of this domain and boot.

        The owner does not matter: a rootless container has other numbers for the same users. What
        has such a name and is not a file counts, too: a hold cannot be written there.
        """
        return entry.name.rpartition("-")[0] == f"{self._prefix}{_boot()}"

    def write(self, state: HoldState) -> None:
        """Write all of `state` into our file, unless it is there already.

        Raises:
            OSError: It cannot be written. What cannot be read is never replaced: it may be a hold.
        """
        path = Path(self.directory) / self._own
        with contextlib.suppress(FileNotFoundError):
            state, old = merged(state, before := _read(str(path))), before
            if state == old:
                return
        if not state:
            return
        _make(path.parent)
        # Renamed at the end, so that nobody reads half of it.
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
        if not stat.S_ISREG(os.lstat(path).st_mode):
            raise UnreadableError(f"{path} is not a regular file: remove it")
        # Not blocking: another user may put a named pipe there after that look.
        flags = os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC
        with open(os.open(path, flags), "rb") as file:
            content = file.read(LONGEST + 1) or b""
    except (FileNotFoundError, UnreadableError):
        raise
    except OSError as error:
        raise UnreadableError(f"{path}: {error.strerror}") from error
    return decode(content.decode("ascii", "replace"))[0]


def _make(directory: Path) -> None:
    with contextlib.suppress(FileExistsError):
        directory.mkdir()
        directory.chmod(_FOR_ALL)
    if not stat.S_ISDIR(directory.lstat().st_mode):
        raise NotADirectoryError(f"{directory} is not a directory")


@cache
def _user_namespace() -> str:
    """Return what makes file names differ where the numbers of users mean different users."""
    try:
        inode = os.stat("/proc/self/ns/user").st_ino
    except OSError:
        return ""
    return "" if inode == _FIRST_USER_NAMESPACE else f".{inode}"


@cache
def _boot() -> str:
    """Return an id that changes when the computer is started: a hold ends then."""
    try:
        return Path("/proc/sys/kernel/random/boot_id").read_text("ascii").strip()[:8]
    except OSError:
        return "0"

"""Writes the wheel of a package, and installs or unpacks it.

pip installs it into this environment, `-o` unpacks it into a folder, and `--wheel` keeps it for a
robot that has no compiler.
"""

from __future__ import annotations

import base64
import contextlib
import csv
import fcntl
import hashlib
import importlib.util
import io
import os
import shutil
import sys
import sysconfig
import tempfile
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache, partial
from importlib.metadata import distributions
from pathlib import Path
from typing import Literal
from zipfile import ZIP_DEFLATED, BadZipFile, ZipFile

from actionkit._interfaces import processes
from actionkit._interfaces.dependencies import Dependency
from actionkit._interfaces.errors import InterfacesError, MissingToolError
from actionkit._interfaces.source_tree import Package

Kind = Literal["environment", "folder", "wheels"]
_PREFIX = ".actionkit-building-"
_LOCAL = "+actionkit"
"""The end of each version. PyPI refuses such a version, so a requirement of our wheels never
matches a package that somebody else has registered under the same name."""
_PIP = ("-m", "pip", "--isolated", "install", "--no-deps", "--no-index", "--force-reinstall", "-q")
"""`--isolated`: the user's settings could put packages elsewhere."""


@dataclass(frozen=True)
class Target:
    """Where packages go: into this Python, into a folder for PYTHONPATH, or a folder for wheels."""

    kind: Kind
    folder: Path
    stage: Path  # the folder from which Python imports new packages

    def place(self, package: Package) -> Path:
        """Return the path of a package: its folder, or its wheel."""
        return self.folder / (_file_name(package) if self.kind == "wheels" else package.name)


@contextlib.contextmanager
def opened(kind: Kind, folder: Path | None) -> Iterator[Target]:
    """Lock a target for one build; others wait. The lock of a build that is killed is free."""
    if kind == "environment" and importlib.util.find_spec("pip") is None:
        raise MissingToolError(
            "there is no pip in this environment to install with: build a wheel, `--wheel wheels`,"
            " and install that: uv pip install wheels/*.whl"
        )
    folder = (folder or Path(sysconfig.get_paths()["platlib"])).absolute()
    with contextlib.ExitStack() as stack:
        try:
            if not folder.exists():
                stack.push(partial(_remove_empty, folder))
            folder.mkdir(parents=True, exist_ok=True)
            handle = os.open(folder, os.O_RDONLY)
            stack.callback(os.close, handle)
            # A lock on the folder itself leaves no file. Some network file systems cannot do it.
            with contextlib.suppress(OSError):
                fcntl.flock(handle, fcntl.LOCK_EX)
            for left in folder.glob(f"{_PREFIX}*"):  # by builds that were killed
                shutil.rmtree(left, ignore_errors=True)
            work = Path(stack.enter_context(workshop(folder)))
        except OSError as error:
            raise InterfacesError(
                f"{folder}: nothing can be written here ({error.strerror}). Choose another folder"
                " with -o, or install into a virtual environment of your own"
            ) from None
        yield Target(kind, folder, work if kind == "wheels" else folder)


def _remove_empty(folder: Path, failed: type[BaseException] | None, *_: object) -> None:
    """Remove a folder that was made for a build which has failed."""
    if failed is not None:
        with contextlib.suppress(OSError):  # it is not empty
            folder.rmdir()


def workshop(folder: Path) -> tempfile.TemporaryDirectory[str]:
    """Make a temporary folder on the same file system as `folder`."""
    return tempfile.TemporaryDirectory(prefix=_PREFIX, dir=folder, ignore_cleanup_errors=True)


def share(package: Package, tree: Path) -> Path:
    """Return the folder in a wheel's tree that pip installs as `share`."""
    return tree / f"{_stem(package)}.data" / "data" / "share"


def _file_name(package: Package) -> str:
    return f"{_stem(package)}-{_tag()}.whl"


def _stem(package: Package) -> str:
    return f"{package.name}-{package.version}{_LOCAL}"


def _tag() -> str:
    """Return the tag for the Python and the kind of machine that a wheel is for."""
    python = f"cp{sys.version_info.major}{sys.version_info.minor}"
    return f"{python}-{python}-{sysconfig.get_platform().replace('-', '_').replace('.', '_')}"


def write(package: Package, tree: Path, used: Iterable[Dependency], folder: Path) -> Path:
    """Write the wheel of a package; `tree` has the files as they are in the wheel."""
    about = tree / f"{_stem(package)}.dist-info"
    about.mkdir()
    lines = [
        "Metadata-Version: 2.1",
        f"Name: {package.name}",
        f"Version: {package.version}{_LOCAL}",
        f"Summary: {package.summary or f'ROS 2 interfaces {package.name}'}",
        f"Requires-Python: =={sys.version_info.major}.{sys.version_info.minor}.*",
        *(f"Requires-Dist: {name}" for name in sorted(_requirements(used))),
    ]
    (about / "METADATA").write_text("\n".join(lines) + "\n", "utf-8")
    (about / "WHEEL").write_text(
        f"Wheel-Version: 1.0\nGenerator: actionkit\nRoot-Is-Purelib: false\nTag: {_tag()}\n"
    )
    record = io.StringIO()
    rows = csv.writer(record, lineterminator="\n")
    path = folder / _file_name(package)
    with ZipFile(path, "w", ZIP_DEFLATED) as file:
        for each in sorted(each for each in tree.rglob("*") if each.is_file()):
            name, data = each.relative_to(tree).as_posix(), each.read_bytes()
            word = base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()
            rows.writerow((name, f"sha256={word}", len(data)))
            file.writestr(name, data)
        name = f"{about.name}/RECORD"
        rows.writerow((name, "", ""))
        file.writestr(name, record.getvalue())
    return path


def _requirements(used: Iterable[Dependency]) -> set[str]:
    """Return the wheel's requirements, such as `ros-geometry-msgs~=5.3.6`: any patch will do."""
    owners = _owners()
    found = {owners[one.name] for one in used if one.record is None and one.name in owners}
    found |= {f"{u.name}=={u.record.version}{_LOCAL}" for u in used if u.record is not None}
    if "rclpy" in owners:
        found.add(owners["rclpy"].replace("~", "[fastrtps]~"))
    return found


@cache
def _owners() -> dict[str, str]:
    """Return importable package -> the distribution that installed it."""
    found = {}
    for one in distributions():
        if one.read_text("WHEEL") is not None:  # others, made by colcon, are inside a distribution
            packages = {file.parts[0] for file in one.files or () if file.name == "__init__.py"}
            found.update(dict.fromkeys(packages, f"{one.metadata['Name']}~={one.version}"))
    return found


def deliver(wheel: Path, package: Package, target: Target) -> None:
    """Install a package into the target."""
    if target.kind == "environment":
        failed = (
            f"pip did not install {wheel.name}. Use a virtual environment of your own, or build a"
            " wheel with --wheel FOLDER. pip says"
        )
        processes.run([sys.executable, *_PIP, str(wheel)], failed, wheel.parent)
        return
    _unpack(wheel, package.name, target.stage)
    if target.kind == "folder":
        # Otherwise colcon would build the packages in `share`.
        (target.folder / "share" / "COLCON_IGNORE").touch()
    else:
        wheel.replace(target.place(package))


def unpack_known(package: Package, target: Target) -> None:
    """Unpack the wheel of an earlier build, so that other packages can use it unchanged."""
    if target.kind == "wheels":
        with contextlib.suppress(OSError, BadZipFile, StopIteration):
            _unpack(target.place(package), package.name, target.stage)


def _unpack(wheel: Path, name: str, folder: Path) -> None:
    with workshop(folder) as work:
        with ZipFile(wheel) as file:
            file.extractall(work)
        shared = next(Path(work).glob("*.data")) / "data" / "share"
        to = folder / "share"
        shutil.copytree(shared / "ament_index", to / "ament_index", dirs_exist_ok=True)
        new = {to / name: shared / name, folder / name: Path(work, name)}
        for there, built in new.items():
            # Moved away first: if the build is killed while deleting, no half package is left.
            if there.exists():
                there.rename(Path(tempfile.mkdtemp(dir=work), name))
            built.rename(there)

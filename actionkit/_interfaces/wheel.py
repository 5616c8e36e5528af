"""The wheel of a package, and the places that it goes to.

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
import subprocess
import sys
import sysconfig
import tempfile
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from importlib.metadata import distributions
from pathlib import Path
from typing import Literal
from zipfile import ZIP_DEFLATED, BadZipFile, ZipFile

from actionkit._interfaces.dependencies import Dependency
from actionkit._interfaces.errors import MissingToolError, TargetError
from actionkit._interfaces.source_tree import Package

_PREFIX = ".actionkit-building-"
_LOCAL = "+actionkit"
"""Ends each version. PyPI takes no such version: so what a wheel requires of ours is never what
somebody else has registered under the same name."""
_PIP = ("-m", "pip", "--isolated", "install", "--no-deps", "--no-index", "--force-reinstall", "-q")
"""`--isolated`: no settings of the user's that put packages elsewhere."""
_SHOWN = 5
"""Lines of pip's errors that are shown."""


@dataclass(frozen=True)
class Target:
    """Where packages go.

    Attributes:
        kind: Into this Python environment, into a folder for PYTHONPATH, or into one for wheels.
        folder: Where the packages, or the wheels, will be.
        stage: Where Python imports those from that were built just now.
    """

    kind: Literal["environment", "folder", "wheels"]
    folder: Path
    stage: Path

    def is_away(self, one: Dependency) -> bool:
        """Return whether a package of ours is elsewhere, so that its place has to be written down.

        Packages that pip installs are all beside each other.
        """
        return (
            self.kind == "folder" and one.record is not None and one.libraries.parent != self.folder
        )


@contextlib.contextmanager
def opened(kind: Literal["environment", "folder", "wheels"], folder: Path) -> Iterator[Target]:
    """Hold a target for one build; others wait. Whoever dies with it lets go of it.

    Raises:
        TargetError: The folder cannot be made or written to.
        MissingToolError: There is no pip to install with.
    """
    if kind == "environment" and importlib.util.find_spec("pip") is None:
        raise MissingToolError(
            "there is no pip in this environment to install with: build a wheel, `--wheel wheels`,"
            " and install that: uv pip install wheels/*.whl"
        )
    folder = folder.absolute()
    with _locked(folder):
        for left in folder.glob(f"{_PREFIX}*"):  # by builds that were killed
            shutil.rmtree(left, ignore_errors=True)
        with contextlib.ExitStack() as stack:
            stage = stack.enter_context(workshop(folder)) if kind == "wheels" else folder
            yield Target(kind, folder, stage)


def site_packages() -> Path:
    """Return where packages of this Python environment are installed."""
    return Path(sysconfig.get_paths()["platlib"])


@contextlib.contextmanager
def _locked(folder: Path) -> Iterator[None]:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
        handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    except OSError as error:
        raise TargetError(
            f"{folder}: nothing can be written here ({error.strerror}). Choose another folder with"
            " -o, or install into a virtual environment of your own"
        ) from None
    try:
        # The folder itself: no file is left behind. Some network file systems cannot.
        with contextlib.suppress(OSError):
            fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        os.close(handle)


@contextlib.contextmanager
def workshop(folder: Path) -> Iterator[Path]:
    """Make a temporary folder on the file system of another one."""
    path = Path(tempfile.mkdtemp(prefix=_PREFIX, dir=folder))
    try:
        yield path
    finally:
        shutil.rmtree(path, ignore_errors=True)


def file_name(package: Package) -> str:
    """Return the name of a package's wheel, for this Python and this kind of machine."""
    return f"{_stem(package)}-{_tag()}.whl"


def share(package: Package, tree: Path) -> Path:
    """Return what becomes the environment's folder `share`, in the tree of a wheel."""
    return tree / f"{_stem(package)}.data" / "data" / "share"


def _stem(package: Package) -> str:
    return f"{package.name}-{package.version}{_LOCAL}"


def _tag() -> str:
    python = f"cp{sys.version_info.major}{sys.version_info.minor}"
    return f"{python}-{python}-{sysconfig.get_platform().replace('-', '_').replace('.', '_')}"


def write(package: Package, tree: Path, used: Iterable[Dependency], folder: Path) -> Path:
    """Write the wheel of a package, of the files in `tree`, which are as they are in the wheel."""
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
        "Wheel-Version: 1.0\nGenerator: actionkit\nRoot-Is-Purelib: false\nTag: " + _tag() + "\n"
    )
    record = io.StringIO()
    rows = csv.writer(record, lineterminator="\n")
    path = folder / file_name(package)
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
    found = {owner.replace("~", "[fastrtps]~") for owner in [owner_of("rclpy")] if owner}
    for one in used:
        if one.record is not None:
            found.add(f"{one.name}=={one.record.version}{_LOCAL}")
        elif (owner := owner_of(one.name)) is not None:
            found.add(owner)
    return found


def owner_of(name: str) -> str | None:
    """Return what installed the importable package of that name: `ros-geometry-msgs~=5.3.6`.

    So the wheels of ROS require each other: the next patches are as good.
    """
    return _owners().get(name)


@cache
def _owners() -> dict[str, str]:
    found = {}
    for one in distributions():
        if one.read_text("WHEEL") is not None:  # others are inside of one, as made by colcon
            packages = {file.parts[0] for file in one.files or () if file.name == "__init__.py"}
            found.update(dict.fromkeys(packages, f"{one.metadata['Name']}~={one.version}"))
    return found


def place(package: Package, target: Target) -> Path:
    """Return where a package goes: its folder, or its wheel."""
    if target.kind == "wheels":
        return target.folder / file_name(package)
    return target.folder / package.name


def deliver(wheel: Path, package: Package, target: Target) -> None:
    """Put a package where it goes.

    Raises:
        TargetError: It cannot be put there; what was there is still there.
    """
    try:
        if target.kind == "environment":
            _install(wheel)
            return
        _unpack(wheel, package.name, target.stage)
        if target.kind == "folder":
            # Else colcon would take what is in `share` for packages to build.
            (target.folder / "share" / "COLCON_IGNORE").touch()
        else:
            wheel.replace(place(package, target))
    except OSError as error:
        raise TargetError(
            f"{error.filename or target.folder}: cannot be written ({error.strerror}): what was"
            " built is not in place. Choose another folder with -o, or a virtual environment"
            " of your own"
        ) from error


def _install(wheel: Path) -> None:
    words = [sys.executable, *_PIP, str(wheel)]
    done = subprocess.run(words, stdin=subprocess.DEVNULL, capture_output=True, check=False)
    if done.returncode:
        lines = done.stderr.decode(errors="replace").strip().splitlines()[:_SHOWN]
        raise TargetError(
            f"pip did not install {wheel.name}. Use a virtual environment of your own, or build a"
            " wheel with --wheel FOLDER. pip says:\n" + "\n".join(lines)
        )


def unpack_known(package: Package, target: Target) -> None:
    """Unpack the wheel of an earlier build, so that others can use it if nothing has changed."""
    with contextlib.suppress(OSError, BadZipFile, StopIteration):
        _unpack(target.folder / file_name(package), package.name, target.stage)


def _unpack(wheel: Path, name: str, folder: Path) -> None:
    with workshop(folder) as work:
        with ZipFile(wheel) as file:
            file.extractall(work)
        shared = next(work.glob("*.data")) / "data" / "share"
        index = Path("share", "ament_index")
        shutil.copytree(shared / "ament_index", folder / index, dirs_exist_ok=True)
        for new, there in ((shared / name, folder / "share" / name), (work / name, folder / name)):
            if there.exists():
                there.rename(work / f"old-{there.parent.name}")
            new.rename(there)

"""All interface packages of a folder, in the order in which they use each other."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

from actionkit._interfaces import checks, distribution, generators, interface_file, objects
from actionkit._interfaces import dependencies as used_packages
from actionkit._interfaces.build_record import BuildRecord, read_record
from actionkit._interfaces.compiler import find_compiler
from actionkit._interfaces.dependencies import IMPLIED
from actionkit._interfaces.errors import TargetError
from actionkit._interfaces.fingerprint import of_package
from actionkit._interfaces.interface_file import InterfaceFile
from actionkit._interfaces.publish import locked, put, workshop
from actionkit._interfaces.source_tree import Package, find_packages
from actionkit._interfaces.staging import index_entries, make


@dataclass(frozen=True)
class Built:
    """A package that is in place.

    Attributes:
        package: What was built.
        place: Its folder.
        seconds: How long it took; `None` where nothing had changed.
        undeclared: Packages that it uses and that its package.xml does not name.
    """

    package: Package
    place: Path
    seconds: float | None
    undeclared: list[str]


@dataclass(frozen=True)
class Target:
    """Where packages go.

    Attributes:
        folder: Where Python packages are imported from.
        share: Where .idl and .msg files go, in a folder for each package.
        installed: Whether it is this Python environment, whose packages pip knows.
    """

    folder: Path
    share: Path
    installed: bool

    @classmethod
    def environment(cls) -> Target:
        """Return this Python environment."""
        return cls(distribution.site_packages(), distribution.prefix() / "share", True)

    @classmethod
    def directory(cls, folder: Path) -> Target:
        """Return a folder, to be put on PYTHONPATH."""
        folder = folder.absolute()
        return cls(folder, folder / "share", False)


def build(
    folder: Path,
    target: Target,
    *,
    shadow: bool = False,
    tell: Callable[[Built], None] = lambda built: None,
) -> list[Built]:
    """Build the interface packages of a folder, those that have changed.

    Args:
        folder: A package, or a folder that has packages below it.
        target: Where they go.
        shadow: Whether a package may have the name of an installed one.
        tell: Called after each package.

    Returns:
        All packages in the order of their building.

    Raises:
        InterfacesError: Something is wrong. Packages that come before it are in place, and what
            was there of the others is as it was.
    """
    checks.no_ros_installation([target.folder])
    generators.check_installed()
    packages = {one.name: one for one in find_packages(folder.absolute(), target.folder)}
    for package in packages.values():
        checks.name(package, target.folder, shadow=shadow)
    read = {one.name: _read(one) for one in packages.values()}
    uses = {name: _uses(name, files) for name, files in read.items()}
    ordered = checks.order({name: uses[name] & set(packages) for name in packages})
    others = used_packages.with_all_they_use(
        set().union(*uses.values()) - set(packages), target.folder
    )
    lacking = {name for name, found in others.items() if found is None} - set(packages)
    checks.missing(read, lacking)
    built = []
    with locked(target.folder):
        for name in ordered:
            built.append(_build(packages[name], read[name], uses[name], target))
            tell(built[-1])
    objects.clear_old()
    return built


def _read(package: Package) -> list[InterfaceFile]:
    files = [interface_file.read(package.name, package.folder, path) for path in package.files]
    checks.files(package, files)
    return files


def _uses(name: str, files: Iterable[InterfaceFile]) -> set[str]:
    found = {use.package for file in files for use in file.uses}
    for file in files:
        found |= IMPLIED[file.path.suffix[1:]]
    return found - {name}


def _build(package: Package, files: list[InterfaceFile], uses: set[str], target: Target) -> Built:
    began = time.monotonic()
    all_used = used_packages.with_all_they_use(uses, target.folder)
    used = {name: one for name, one in all_used.items() if one is not None}
    checks.types(package, files, used)
    named = {use.package for file in files for use in file.uses} - {package.name}
    undeclared = sorted(named - package.declared)
    place = target.folder / package.name
    key = of_package(
        {file.path.as_posix(): file.text for file in files},
        (package.folder / "package.xml").read_bytes(),
        used.values(),
        target.folder,
    )
    before = read_record(place)
    metadata = target.folder / distribution.metadata_folder(package)
    is_listed = not target.installed or metadata.is_dir()
    if before is not None and before.key == key and before.is_complete(place) and is_listed:
        return Built(package, place, None, undeclared)
    compiler = find_compiler()
    with workshop(target.folder) as work:
        made = make(package, files, used, work, target.folder, compiler)
        share = target.share / package.name
        where = os.path.relpath(share, place)
        record = BuildRecord(package.name, package.version, key, sorted(used), where, made)
        record.write(work / package.name)
        try:
            _put(package, work, target, share)
        except OSError as error:
            raise TargetError(
                f"{error.filename or target.folder}: cannot be written ({error.strerror}): what was"
                " built is not in place. Choose another folder with -o, or a virtual environment"
                " of your own"
            ) from error
    return Built(package, place, time.monotonic() - began, undeclared)


def _put(package: Package, work: Path, target: Target, share: Path) -> None:
    """Put a package into place: what only tells of it first, then the package itself."""
    place = target.folder / package.name
    index = target.share / "ament_index" / "resource_index"
    entries = [index / name for name in index_entries(package)]
    for path, text in zip(entries, index_entries(package).values(), strict=True):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, "utf-8")
    if not target.installed:
        # Else colcon would take what is in `share` for packages to build.
        (target.share / "COLCON_IGNORE").touch()
    with workshop(target.share) as beside:
        shutil.copytree(work / "share", beside / package.name)
        put(beside / package.name, share)
    put(work / package.name, place)
    if not target.installed:
        return
    files = [path for top in (place, share) for path in sorted(top.rglob("*")) if path.is_file()]
    distribution.write_metadata(package, work / "metadata", [*files, *entries])
    put(work / "metadata", target.folder / distribution.metadata_folder(package))
    for older in distribution.older_metadata(package):
        shutil.rmtree(older, ignore_errors=True)

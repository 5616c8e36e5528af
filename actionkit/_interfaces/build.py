"""All interface packages of a folder, in the order in which they use each other."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from actionkit._interfaces import checks, generators, interface_file, staging, wheel
from actionkit._interfaces import dependencies as used_packages
from actionkit._interfaces.compile import find_compiler
from actionkit._interfaces.dependencies import IMPLIED, BuildRecord, read_record
from actionkit._interfaces.fingerprint import of_package
from actionkit._interfaces.interface_file import InterfaceFile
from actionkit._interfaces.selection import select
from actionkit._interfaces.source_tree import Package, find_packages
from actionkit._interfaces.wheel import Target


@dataclass(frozen=True)
class Built:
    """A package that is in place.

    Attributes:
        package: What was built.
        place: Its folder, or its wheel.
        seconds: How long it took; `None` where nothing had changed.
        notes: What colcon would refuse.
    """

    package: Package
    place: Path
    seconds: float | None
    notes: list[str]


def build(
    folder: Path,
    target: Target,
    *,
    only: Collection[str] = (),
    tell: Callable[[Built], None],
    progress: Callable[[Package, float], None],
) -> list[Built]:
    """Build the interface packages of a folder, those that have changed.

    Args:
        folder: A package, or a folder that has packages below it.
        target: Where they go.
        only: Some types, as `action/Pick`; all if there are none.
        tell: Called after each package.
        progress: Called while one is built, with the part of the work that is done.

    Returns:
        All packages in the order of their building.

    Raises:
        InterfacesError: Something is wrong. Packages that come before it are in place, and what
            was there of the others is as it was.
    """
    checks.no_ros_installation([target.stage])
    generators.check_installed()
    packages = {one.name: one for one in find_packages(folder.absolute(), target.folder)}
    read = {name: _read(one) for name, one in packages.items()}
    if only:
        read = select(read, only)
        packages = {
            name: replace(packages[name], files=tuple(file.path for file in files))
            for name, files in read.items()
        }
    for name, package in packages.items():
        checks.name(package, target.stage)
        checks.files(package, read[name])
        if target.kind == "wheels":
            wheel.unpack_known(package, target)
    uses = {name: _uses(name, files) for name, files in read.items()}
    ordered = checks.order({name: uses[name] & set(packages) for name in packages})
    others = used_packages.with_all_they_use(
        set().union(*uses.values()) - set(packages), target.stage
    )
    lacking = {name for name, found in others.items() if found is None} - set(packages)
    checks.missing(read, lacking)
    built = []
    for name in ordered:
        built.append(_build(packages[name], read[name], uses[name], target, progress))
        tell(built[-1])
    return built


def _read(package: Package) -> list[InterfaceFile]:
    return [interface_file.read(package.name, package.folder, path) for path in package.files]


def _uses(name: str, files: Iterable[InterfaceFile]) -> set[str]:
    found = {use.package for file in files for use in file.uses}
    for file in files:
        found |= IMPLIED[file.path.suffix[1:]]
    return found - {name}


def _build(
    package: Package,
    files: list[InterfaceFile],
    uses: set[str],
    target: Target,
    progress: Callable[[Package, float], None],
) -> Built:
    began = time.monotonic()
    all_used = used_packages.with_all_they_use(uses, target.stage)
    used = {name: one for name, one in all_used.items() if one is not None}
    checks.types(package, files, used)
    named = {use.package for file in files for use in file.uses} - {package.name}
    notes = [note for file in files for note in file.notes]
    if undeclared := sorted(named - package.declared):
        tags = "".join(f"<depend>{other}</depend>" for other in undeclared)
        notes.append(f"{package.folder / 'package.xml'}: add {tags}")
    place = target.stage / package.name
    key = of_package(
        {file.path.as_posix(): file.text for file in files},
        (package.folder / "package.xml").read_bytes(),
        used.values(),
        target,
    )
    before = read_record(place)
    if before is not None and before.key == key and before.is_complete(place):
        return Built(package, wheel.place(package, target), None, notes)
    compiler = find_compiler()
    progress(package, 0.0)
    with wheel.workshop(target.folder) as work:
        tree = work / "tree"
        made = staging.make(
            package, files, used, work, tree, target, compiler, partial(progress, package)
        )
        BuildRecord(package.name, package.version, key, sorted(used), made).write(
            tree / package.name
        )
        direct = [used[name] for name in uses]
        wheel.deliver(wheel.write(package, tree, direct, work), package, target)
    return Built(package, wheel.place(package, target), time.monotonic() - began, notes)

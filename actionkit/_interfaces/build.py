"""Builds all interface packages of a folder, in the order in which they use each other."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import sys
import sysconfig
import time
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from actionkit._interfaces import checks, compile, dependencies, generators, processes, wheel
from actionkit._interfaces.dependencies import BuildRecord, Dependency
from actionkit._interfaces.processes import Progress
from actionkit._interfaces.selection import select
from actionkit._interfaces.source_tree import GROUP, Package, find_packages
from actionkit._interfaces.wheel import Target

_FORMAT = 4
"""Increase this when the build makes something else from the same sources."""
_GENERATING = 0.4
"""The part of the time that the generators take."""
_LOAD = """
import importlib, json, sys
package, names = json.loads(sys.argv[1])
# First by itself: where a type imports it, the reason of a failure is lost.
importlib.import_module(f"{package}.{package}_s__rosidl_typesupport_c")
for kind, name in names:
    cls = getattr(importlib.import_module(f"{package}.{kind}"), name)
    type(cls).__import_type_support__()
    if type(cls)._TYPE_SUPPORT is None:
        sys.exit(f"{package}.{kind}.{name} has no type support")
"""


@dataclass(frozen=True)
class Built:
    """A package that is in place."""

    package: Package
    place: Path  # its folder, or its wheel
    seconds: float | None  # `None` if nothing had changed
    notes: list[str]  # what colcon would refuse


def build(
    folder: Path, target: Target, only: Collection[str], progress: Callable[[Package, float], None]
) -> Iterator[Built]:
    """Build the interface packages of a folder that have changed, or some of their types only.

    `progress` gets the part of a package that is done, 0 to 1. After an `InterfacesError`, the
    packages before that one are in place, and the others have not changed.
    """
    checks.no_ros_installation(target.stage)
    generators.check_installed()
    packages = find_packages(folder.absolute(), target.folder)
    if only:
        packages = select(packages, only)
    for package in packages.values():
        checks.name(package, target.stage)
        checks.files(package)
    ordered = checks.order(packages.values())
    foreign = set[str]().union(*(package.uses() for package in ordered)) - set(packages)
    _, missing = dependencies.with_all_they_use(foreign, target.stage)
    checks.missing(packages, missing - set(packages))
    for package in ordered:
        yield _build(package, target, progress)


def _build(package: Package, target: Target, progress: Callable[[Package, float], None]) -> Built:
    began = time.monotonic()
    wheel.unpack_known(package, target)
    used, _ = dependencies.with_all_they_use(package.uses(), target.stage)
    checks.types(package, used)
    notes = [note for file in package.files for note in file.notes]
    named = {use.package for file in package.files for use in file.uses} - {package.name}
    if undeclared := sorted(named - package.declared):
        tags = "".join(f"<depend>{other}</depend>" for other in undeclared)
        notes.append(f"{package.folder / 'package.xml'}: add {tags}")
    if not package.in_group:
        tag = f"<member_of_group>{GROUP}</member_of_group>"
        notes.append(f"{package.folder / 'package.xml'}: add {tag}")
    there = target.stage / package.name
    key = _fingerprint(package, used.values(), target)
    before = dependencies.read_record(there)
    if before is not None and before.key == key and before.is_complete(there):
        return Built(package, target.place(package), None, notes)
    with wheel.workshop(target.folder) as name:
        tree = _make(package, used.values(), Path(name), target, partial(progress, package))
        libraries = dependencies.libraries_in(tree / package.name)
        record = BuildRecord(package.name, package.version, key, sorted(used), libraries)
        record.write(tree / package.name)
        direct = [used[other] for other in package.uses()]
        wheel.deliver(wheel.write(package, tree, direct, Path(name)), package, target)
    return Built(package, target.place(package), time.monotonic() - began, notes)


def _fingerprint(package: Package, used: Collection[Dependency], target: Target) -> str:
    """Return a hash of everything that a package is made from."""
    parts: list[object] = [_FORMAT, sysconfig.get_config_var("EXT_SUFFIX")]
    parts += [os.environ.get(name) for name in compile.VARIABLES]
    parts += [(file.path, file.text) for file in package.files]
    read = [package.folder / "package.xml"]
    read += sorted(Path(sys.prefix, "share").glob("rosidl_*/package.xml"))  # the generators
    for one in used:
        # In a folder for PYTHONPATH, libraries contain the paths of the libraries that they use.
        parts += [one.name, one.record, one.libraries if target.kind == "folder" else None]
        read.append(one.share / "package.xml")
    parts += [path.read_bytes() for path in read]
    return hashlib.sha256(repr(parts).encode()).hexdigest()


def _make(
    package: Package, used: Collection[Dependency], folder: Path, target: Target, progress: Progress
) -> Path:
    """Generate, compile and link a package, check that Python can load it, and return its tree."""
    work, tree = folder / "work", folder / "tree"

    def compiling(part: float) -> None:
        progress(_GENERATING + (1 - _GENERATING) * part)

    compile.find_compiler()  # without one, do not begin
    progress(0.0)
    generators.generate(package, used, work, lambda part: progress(_GENERATING * part))
    made = tree / package.name
    _copy(work / "rosidl_generator_py" / package.name, made, but_for=("*.c", "__pycache__"))
    (made / "__init__.py").touch()
    for library in generators.LIBRARIES:
        headers = made / "include" / package.name
        _copy(work / library / package.name, headers, but_for=("*.c*", "*.py"))
    compile.build_libraries(work, made, used, target, compiling)
    _fill_share(package, work, wheel.share(package, tree))
    _try_to_load(package, used, tree)
    return tree


def _copy(source: Path, to: Path, but_for: Collection[str] = ()) -> None:
    shutil.copytree(source, to, ignore=shutil.ignore_patterns(*but_for), dirs_exist_ok=True)


def _fill_share(package: Package, work: Path, top: Path) -> None:
    """Write what colcon writes into `share`: the package's files, .idl, hashes and an index."""
    share = top / package.name
    _copy(work / "idl", share)
    paths = [file.path for file in package.files]
    for path in (Path("package.xml"), *paths):
        shutil.copyfile(package.folder / path, share / path)
    for path in (path.with_suffix(".json") for path in paths):
        shutil.copyfile(work / generators.HASHES / package.name / path, share / path)
    files = [name.as_posix() for path in paths for name in (path, path.with_suffix(".idl"))]
    for name, text in (("packages", ""), ("rosidl_interfaces", "\n".join(sorted(files)))):
        path = top / "ament_index" / "resource_index" / name / package.name
        path.parent.mkdir(parents=True)
        path.write_text(text, "utf-8")


def _try_to_load(package: Package, used: Collection[Dependency], tree: Path) -> None:
    """Load the type support of all types in a process of its own."""
    names = [(file.kind, file.path.stem) for file in package.files]
    # The others are beside the place where the package will be, not where it is now.
    own = [one.libraries for one in used if one.record is not None]
    found = {"PYTHONPATH": [tree, *(path.parent for path in own)], "LD_LIBRARY_PATH": own}
    paths = {
        name: os.pathsep.join(filter(None, [*map(str, new), os.environ.get(name, "")]))
        for name, new in found.items()
    }
    processes.run(
        [sys.executable, "-c", _LOAD, json.dumps([package.name, names])],
        f"{package.name}: was compiled, but Python cannot load it",
        tree,
        {**os.environ, **paths, "PYTHONDONTWRITEBYTECODE": "1"},
    )

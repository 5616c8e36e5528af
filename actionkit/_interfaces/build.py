"""All interface packages of a folder, in the order in which they use each other."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from actionkit._interfaces import checks, compile, generators, interface_file, wheel
from actionkit._interfaces import dependencies as used_packages
from actionkit._interfaces.compile import Compiler, find_compiler
from actionkit._interfaces.dependencies import IMPLIED, BuildRecord, Dependency, read_record
from actionkit._interfaces.errors import InterfacesError
from actionkit._interfaces.fingerprint import of_package
from actionkit._interfaces.interface_file import InterfaceFile
from actionkit._interfaces.selection import select
from actionkit._interfaces.source_tree import Package, find_packages
from actionkit._interfaces.wheel import Target

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
    key = of_package(package, files, used.values(), target)
    before = read_record(place)
    if before is not None and before.key == key and before.is_complete(place):
        return Built(package, wheel.place(package, target), None, notes)
    compiler = find_compiler()
    progress(package, 0.0)
    with wheel.workshop(target.folder) as work:
        tree = work / "tree"
        made = _make(package, files, used, work, tree, target, compiler, partial(progress, package))
        BuildRecord(package.name, package.version, key, sorted(used), made).write(
            tree / package.name
        )
        direct = [used[name] for name in uses]
        wheel.deliver(wheel.write(package, tree, direct, work), package, target)
    return Built(package, wheel.place(package, target), time.monotonic() - began, notes)


def _make(
    package: Package,
    files: Iterable[InterfaceFile],
    dependencies: Mapping[str, Dependency],
    work: Path,
    tree: Path,
    target: Target,
    compiler: Compiler,
    progress: Callable[[float], None],
) -> dict[str, int]:
    """Generate, compile and link a package, and try that Python can load it.

    Returns:
        The names of the libraries with their sizes in bytes.

    Raises:
        InterfacesError: Something fails.
    """
    files = list(files)
    used = list(dependencies.values())
    area = work / "work"
    for file in files:
        path = area / "source" / file.path
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(file.text, "utf-8")
    names = [file.path for file in files]
    generators.generate(package.name, names, used, area, lambda part: progress(_GENERATING * part))
    folder = tree / package.name
    shutil.copytree(
        area / "python" / package.name, folder, ignore=shutil.ignore_patterns("*.c", "__pycache__")
    )
    (folder / "__init__.py").touch()
    headers = folder / "include" / package.name
    for library in ("c", "fastrtps", "introspection"):
        source = area / library / package.name
        only_headers = shutil.ignore_patterns("*.c", "*.cpp")
        shutil.copytree(source, headers, ignore=only_headers, dirs_exist_ok=True)

    made = compile.build_libraries(
        package.name,
        area,
        folder,
        used,
        compiler,
        target,
        lambda part: progress(_GENERATING + (1 - _GENERATING) * part),
    )
    _fill_share(package, files, area, wheel.share(package, tree))
    _try_to_load(package, files, used, tree)
    return made


def _fill_share(package: Package, files: Iterable[InterfaceFile], area: Path, top: Path) -> None:
    """Write what colcon writes into `share`: the package's files, .idl, hashes and an index."""
    hashes = area / "hashes" / package.name
    share = top / package.name
    for file in files:
        folder = share / file.path.parent
        folder.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(package.folder / file.path, share / file.path)
        idl = file.path.with_suffix(".idl")
        shutil.copyfile(area / "idl" / idl, share / idl)
        json_file = file.path.with_suffix(".json")
        shutil.copyfile(hashes / json_file, share / json_file)
    shutil.copyfile(package.folder / "package.xml", share / "package.xml")
    for name, text in _index_entries(package).items():
        path = top / "ament_index" / "resource_index" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, "utf-8")


def _index_entries(package: Package) -> dict[str, str]:
    """Return the entries of the resource index, by which tools of ROS find packages."""
    names = sorted(
        name.as_posix() for file in package.files for name in (file, file.with_suffix(".idl"))
    )
    return {
        f"packages/{package.name}": "",
        f"rosidl_interfaces/{package.name}": "\n".join(names),
        f"package_run_dependencies/{package.name}": ";".join(
            sorted({"rosidl_default_runtime", *package.declared - {"rosidl_default_generators"}})
        ),
    }


def _try_to_load(
    package: Package, files: Iterable[InterfaceFile], used: Iterable[Dependency], tree: Path
) -> None:
    """Load the type support of all types in a process of its own."""
    names = [(file.path.suffix[1:], file.path.stem) for file in files]
    own = [one for one in used if one.record is not None]
    found = [tree, *(one.libraries.parent for one in own), os.environ.get("PYTHONPATH", "")]
    searched = [one.libraries for one in own]
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join(filter(None, map(str, found))),
        # The others are where the package will be, not where it is now.
        "LD_LIBRARY_PATH": os.pathsep.join(
            filter(None, [*map(str, searched), os.environ.get("LD_LIBRARY_PATH", "")])
        ),
        "PYTHONDONTWRITEBYTECODE": "1",
    }
    done = subprocess.run(
        [sys.executable, "-c", _LOAD, json.dumps([package.name, names])],
        cwd=tree,
        env=environment,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        check=False,
    )
    if done.returncode:
        lines = done.stderr.decode(errors="replace").strip().splitlines()[-5:]
        raise InterfacesError(
            f"{package.name}: was compiled, but Python cannot load it:\n" + "\n".join(lines)
        )

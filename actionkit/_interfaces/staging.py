"""One package, from its checked files to a folder that can be put into place."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

from actionkit._interfaces import compile, generators, wheel
from actionkit._interfaces.compile import Compiler
from actionkit._interfaces.dependencies import Dependency
from actionkit._interfaces.errors import InterfacesError
from actionkit._interfaces.interface_file import InterfaceFile
from actionkit._interfaces.source_tree import KINDS, Package
from actionkit._interfaces.wheel import Target

_RUN_TIME_DEPENDENCIES = "rosidl_default_runtime"
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


def make(
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

    Args:
        package: The package.
        files: Its files, checked.
        dependencies: All packages that these use, with those that they use in turn.
        work: An empty folder.
        tree: What becomes of `work/tree`: the files of the wheel.
        target: Where the package goes.
        compiler: What compiles it.
        progress: Told which part of the work is done.

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
            sorted({_RUN_TIME_DEPENDENCIES, *package.declared - {"rosidl_default_generators"}})
        ),
    }


def _try_to_load(
    package: Package, files: Iterable[InterfaceFile], used: Iterable[Dependency], tree: Path
) -> None:
    """Load the type support of all types in a process of its own."""
    names = [(file.path.suffix[1:], file.path.stem) for file in files]
    assert all(kind in KINDS for kind, _ in names)
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

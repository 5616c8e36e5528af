"""Compiles generated C and C++ to a package's libraries and the module that Python loads."""

from __future__ import annotations

import importlib.util
import os
import platform
import shlex
import shutil
import sys
import sysconfig
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path

from actionkit._interfaces import processes
from actionkit._interfaces.dependencies import Dependency
from actionkit._interfaces.errors import MissingToolError
from actionkit._interfaces.generators import LIBRARIES
from actionkit._interfaces.processes import Progress
from actionkit._interfaces.wheel import Target

_OPTIMIZE = "-O1"
"""With `-O2` compiling takes 1.5 times as long, and the libraries are not faster: a message of
2,000 parts is converted and written in 1.7 ms and read in 3.4 ms with both (within 3 %)."""
_TYPES_IN_A_UNIT = 8
"""Files that are compiled as one. Most of the time goes into the headers, so larger units are
faster (a whole package at once takes a fifth of the time), but each processor should have a
unit."""
VARIABLES = ("CC", "CXX", "CPPFLAGS", "CFLAGS", "CXXFLAGS", "LDFLAGS")
"""The environment variables that say how to compile."""
_MODULE = "module"
"""The name for the module that Python loads, beside the libraries."""


def find_compiler() -> tuple[list[str], list[str]]:
    """Return the commands for C and C++: CC and CXX, or the first of gcc, clang and ziglang."""
    if not Path(python_headers(), "Python.h").is_file():
        version = f"{sys.version_info.major}.{sys.version_info.minor}"
        raise MissingToolError(
            f"Python.h is not in {python_headers()}: it is needed to compile."
            f" On Ubuntu: sudo apt install python{version}-dev"
        )
    known = [(["gcc"], ["g++"]), (["cc"], ["c++"]), (["clang"], ["clang++"])]
    if importlib.util.find_spec("ziglang") is not None:
        zig = [sys.executable, "-m", "ziglang"]
        # For the C library that Python was linked with, not the newest one that zig knows.
        system = ["-target", f"{platform.machine()}-linux-gnu"]
        known.append(([*zig, "cc", *system], [*zig, "c++", *system]))
    cc, cxx = _variable("CC"), _variable("CXX")
    for c, cpp in known:
        if (cc or shutil.which(c[0])) and (cxx or shutil.which(cpp[0])):
            cc, cxx = cc or c, cxx or cpp
    if not cc or not cxx:
        raise MissingToolError(
            "a C++ compiler is needed to build interfaces, and none is on PATH. On Ubuntu:"
            " sudo apt install g++ (or, without root: pip install ziglang, which is slower)"
        )
    for name, words in (("CC", cc), ("CXX", cxx)):
        if shutil.which(words[0]) is None:
            raise MissingToolError(
                f"the variable {name} of the environment names {words[0]!r}, which is not here:"
                f" install it, or unset {name}"
            )
    return cc, cxx


def python_headers() -> str:
    """Return the folder where Python.h should be."""
    return sysconfig.get_paths()["include"]


def _variable(name: str) -> list[str]:
    return shlex.split(os.environ.get(name, ""))


@dataclass(frozen=True)
class _Unit:
    """Generated files that are compiled as one, relative to the working folder."""

    part_of: str  # one of `LIBRARIES`, or `_MODULE`
    files: tuple[Path, ...]

    @property
    def is_cpp(self) -> bool:
        return self.files[0].suffix == ".cpp"


def _units(work: Path) -> Iterator[_Unit]:
    groups: dict[tuple[str, Path, str], list[Path]] = {}
    for path in sorted(work.glob("rosidl_*/**/*.c*")):
        file = path.relative_to(work)
        part_of = _MODULE if ".ep." in file.name else file.parts[0]
        # Files of one kind and role never define the same name, except descriptions.
        role = file.stem if file.stem.endswith("__description") else file.stem.rpartition("_")[2]
        groups.setdefault((part_of, file.parent, role), []).append(file)
    for (part_of, _, _), group in groups.items():
        for start in range(0, len(group), _TYPES_IN_A_UNIT):
            yield _Unit(part_of, tuple(group[start : start + _TYPES_IN_A_UNIT]))


def build_libraries(
    work: Path, folder: Path, used: Collection[Dependency], target: Target, progress: Progress
) -> None:
    """Compile and link the package in a folder, from the sources in `work`."""
    cc, cxx = find_compiler()
    common = ["-fPIC", "-w", "-Ulinux", "-Uunix", *_variable("CPPFLAGS")]
    common += [word for path in _includes(used) for word in ("-I", str(path))]
    c = [*cc, "-std=gnu11", *(_variable("CFLAGS") or [_OPTIMIZE]), *common]
    cpp = [*cxx, "-std=gnu++17", *(_variable("CXXFLAGS") or [_OPTIMIZE]), *common]
    # The slowest ones first.
    units = sorted(_units(work), key=lambda unit: (not unit.is_cpp, -len(unit.files)))
    (work / "objects").mkdir()
    objects = {unit: work / "objects" / f"{number}.o" for number, unit in enumerate(units)}

    def compile_unit(unit: _Unit) -> None:
        text = objects[unit].with_suffix(unit.files[0].suffix)
        text.write_text("".join(f'#include "{file}"\n' for file in unit.files), "utf-8")
        words = [*(cpp if unit.is_cpp else c), "-c", str(text), "-o", str(objects[unit])]
        processes.run(words, f"compiling {unit.files[0].name}: {words[0]} failed", work)

    processes.each(compile_unit, units, progress)
    own: list[Path] = []
    for part in (*LIBRARIES, _MODULE):
        name = f"lib{folder.name}__{part}.so"
        if part == _MODULE:
            ending = sysconfig.get_config_var("EXT_SUFFIX")
            name = f"{folder.name}_s__rosidl_typesupport_c{ending}"
        words = [*cxx, "-shared", "-o", str(folder / name), f"-Wl,-soname,{name}"]
        words += sorted(str(path) for unit, path in objects.items() if unit.part_of == part)
        words += _link_flags(own, used, target)
        processes.run(words, f"linking {name}: {words[0]} failed", folder)
        own.append(folder / name)


def _includes(used: Collection[Dependency]) -> list[Path]:
    import numpy

    wheels = Path(sys.prefix, "include")
    return [
        # Not as `..` from the working folder: behind a link, that is another folder.
        Path(),
        *map(Path, LIBRARIES),
        *(one.include for one in used if one.record is not None),
        Path(python_headers()),
        Path(numpy.get_include()),
        wheels,  # for Fast CDR; the headers of all others are in a folder of their package's name
        *sorted(path for path in wheels.iterdir() if path.is_dir()),
    ]


def _link_flags(own: Collection[Path], used: Collection[Dependency], target: Target) -> list[str]:
    # rosidl_typesupport_c looks for two of the libraries by name when a type is first used. It
    # finds them only if they are loaded already, so the linker must not drop them as unused
    # (--no-as-needed). The search path is of the old kind, which is used before LD_LIBRARY_PATH:
    # a package that was built again must not get the libraries of the installed one.
    ours = [one for one in used if one.record is not None]
    search = ["$ORIGIN", *(f"$ORIGIN/../{one.name}" for one in ours)]
    if target.kind == "folder":  # the others may be in other folders
        search += [str(one.libraries) for one in ours]
    theirs = [path for one in used for path in one.libraries.glob(f"lib{one.name}__rosidl_*.so")]
    for name in ("librosidl_*.so", "libfastcdr.so", "librcutils.so"):
        theirs += Path(sys.prefix, "lib").glob(name)
    return [
        "-Wl,--disable-new-dtags",
        # Not with -Wl, which would split a path at a comma.
        *(word for path in search for word in ("-Xlinker", "-rpath", "-Xlinker", path)),
        "-Wl,--no-as-needed",
        *map(str, own),
        "-Wl,--as-needed",
        *sorted(map(str, theirs)),
        "-s",
        *_variable("LDFLAGS"),
    ]

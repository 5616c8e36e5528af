"""From generated C and C++ to the libraries of a package and the module that Python loads."""

from __future__ import annotations

import importlib.util
import os
import platform
import shlex
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from actionkit._interfaces.dependencies import Dependency
from actionkit._interfaces.errors import InterfacesError, MissingToolError
from actionkit._interfaces.generators import LIBRARIES
from actionkit._interfaces.parallel import each
from actionkit._interfaces.wheel import Target

_SHOWN = 12
"""Lines of a compiler's errors that are shown; the first one is the cause."""
_OPTIMIZE = "-O1"
"""`-O2` takes half as long again for the compiler. A message of 2,000 parts is then converted and
written in 1.7 ms and read in 3.4 ms, as with `-O1` (within 3 %)."""
_TYPES_IN_A_UNIT = 8
"""Files that are compiled as one. The headers cost more than the types: all files of a package at
once take a fifth of the time that each alone takes; but all processors should have work."""
_RUNTIME = (
    "rosidl_runtime_c",
    "rosidl_typesupport_c",
    "rosidl_typesupport_fastrtps_c",
    "rosidl_typesupport_fastrtps_cpp",
    "rosidl_typesupport_introspection_c",
    "fastcdr",
    "rcutils",
)


@dataclass(frozen=True)
class Compiler:
    """The words of the commands, and the flags of every compilation."""

    c: tuple[str, ...]
    cpp: tuple[str, ...]
    link: tuple[str, ...]
    link_flags: tuple[str, ...]


def find_compiler() -> Compiler:
    """Return the compiler: by CC and CXX, or gcc, clang or the package ziglang, the first there is.

    Raises:
        MissingToolError: There is none, or Python.h is missing.
    """
    if not Path(python_headers(), "Python.h").is_file():
        version = f"{sys.version_info.major}.{sys.version_info.minor}"
        raise MissingToolError(
            f"Python.h is not in {python_headers()}: it is needed to compile."
            f" On Ubuntu: sudo apt install python{version}-dev"
        )
    cc, cxx = (_words(name) for name in ("CC", "CXX"))
    for c, cpp in ((["gcc"], ["g++"]), (["cc"], ["c++"]), (["clang"], ["clang++"]), _zig()):
        if (cc or _is_here(c)) and (cxx or _is_here(cpp)):
            cc, cxx = cc or c, cxx or cpp
            break
    if not cc or not cxx:
        raise MissingToolError(
            "a C++ compiler is needed to build interfaces, and none is on PATH. On Ubuntu:"
            " sudo apt install g++ (or, without root: pip install ziglang, which is slower)"
        )
    for name, words in (("CC", cc), ("CXX", cxx)):
        if not _is_here(words):
            raise MissingToolError(
                f"the variable {name} of the environment names {words[0]!r}, which is not here:"
                f" install it, or unset {name}"
            )
    common = ["-fPIC", "-w", "-Ulinux", "-Uunix", *_words("CPPFLAGS")]
    return Compiler(
        (*cc, "-std=gnu11", *common, *(_words("CFLAGS") or [_OPTIMIZE])),
        (*cxx, "-std=gnu++17", *common, *(_words("CXXFLAGS") or [_OPTIMIZE])),
        tuple(cxx),
        tuple(_words("LDFLAGS")),
    )


def python_headers() -> str:
    """Return the folder that Python.h belongs into."""
    return sysconfig.get_paths()["include"]


def _words(variable: str) -> list[str]:
    return shlex.split(os.environ.get(variable, ""))


def _is_here(words: list[str]) -> bool:
    return shutil.which(words[0]) is not None


def _zig() -> tuple[list[str], list[str]]:
    if importlib.util.find_spec("ziglang") is None:
        return ["ziglang"], ["ziglang"]  # no such commands: there is no compiler
    # The C library that Python was linked with, not the newest that zig knows.
    target = ["-target", f"{platform.machine()}-linux-gnu"]
    zig = [sys.executable, "-m", "ziglang"]
    return [*zig, "cc", *target], [*zig, "c++", *target]


def _run(words: Sequence[str], folder: Path, what: str) -> None:
    done = subprocess.run(
        words, cwd=folder, stdin=subprocess.DEVNULL, capture_output=True, check=False
    )
    if done.returncode:
        lines = done.stderr.decode(errors="replace").strip().splitlines()
        shown = "\n".join(lines[:_SHOWN])
        raise InterfacesError(f"{what}: {words[0]} failed (exit code {done.returncode}):\n{shown}")


@dataclass(frozen=True)
class _Unit:
    """Generated files of one library that are compiled as one, relative to the working folder."""

    library: str
    files: tuple[Path, ...]

    @property
    def is_cpp(self) -> bool:
        return self.files[0].suffix == ".cpp"

    @property
    def is_module(self) -> bool:
        return ".ep." in self.files[0].name


def _units(work: Path) -> Iterator[_Unit]:
    for library in LIBRARIES:
        groups: dict[tuple[str, ...], list[Path]] = {}
        for path in sorted((work / library).rglob("*.c*")):
            file = path.relative_to(work)
            # Within one kind and role no two files define one name; descriptions all do.
            alone = file.stem if file.stem.endswith("__description") or ".ep." in file.name else ""
            role = file.stem.rpartition("__")[2] if library == "c" else ""
            groups.setdefault((str(file.parent), role, alone), []).append(file)
        for group in groups.values():
            for start in range(0, len(group), _TYPES_IN_A_UNIT):
                yield _Unit(library, tuple(group[start : start + _TYPES_IN_A_UNIT]))


def build_libraries(
    package: str,
    work: Path,
    folder: Path,
    used: Sequence[Dependency],
    compiler: Compiler,
    target: Target,
    progress: Callable[[float], None],
) -> dict[str, int]:
    """Compile and link a package.

    Returns:
        The names of the libraries with their sizes in bytes.

    Raises:
        InterfacesError: The compiler fails.
    """
    flags = [word for path in _includes(work, used) for word in ("-I", str(path))]
    # Those that take longest first.
    units = sorted(_units(work), key=lambda unit: (not unit.is_cpp, -len(unit.files)))
    output = work / "objects"
    output.mkdir()

    def compiled(unit: _Unit) -> Path:
        text = output / f"{units.index(unit)}{unit.files[0].suffix}"
        text.write_text("".join(f'#include "{file}"\n' for file in unit.files), "utf-8")
        words = [*(compiler.cpp if unit.is_cpp else compiler.c), "-I", ".", *flags]
        made = text.with_suffix(".o")
        _run([*words, "-c", str(text), "-o", str(made)], work, f"compiling {unit.files[0].name}")
        return made

    objects = dict(zip(units, each(compiled, units, progress), strict=True))
    return _link(package, folder, objects, used, compiler, target)


def _includes(work: Path, used: Iterable[Dependency]) -> list[Path]:
    import numpy

    wheels = Path(sys.prefix, "include")
    return [
        # Not a way up from `work`: where a link is on it, that leads elsewhere.
        *(Path(library) for library in LIBRARIES if library != "dispatch"),
        *(one.include for one in used if one.record is not None),
        Path(python_headers()),
        Path(numpy.get_include()),
        wheels,  # Fast CDR's lie here, all others in a folder of their package's name
        *sorted(path for path in wheels.iterdir() if path.is_dir()),
    ]


def _link(
    package: str,
    folder: Path,
    objects: dict[_Unit, Path],
    used: Sequence[Dependency],
    compiler: Compiler,
    target: Target,
) -> dict[str, int]:
    # rosidl_typesupport_c looks for two of the libraries by their names when a type is first
    # used. They are found because they are loaded already, so they are needed whatever the
    # linker thinks. The search path is the old kind, which counts more than LD_LIBRARY_PATH:
    # a package that was built again must not get the libraries of the installed one.
    ours = [one for one in used if one.record is not None]
    search = [
        "$ORIGIN",
        *(str(o.libraries) if target.is_away(o) else f"$ORIGIN/../{o.name}" for o in ours),
    ]
    wheels = Path(sys.prefix, "lib")
    common = [
        "-Wl,--disable-new-dtags",
        # Not with -Wl, which takes a comma in a path for the end of it.
        *(word for path in search for word in ("-Xlinker", "-rpath", "-Xlinker", path)),
        *(f"-L{path}" for path in (folder, *(one.libraries for one in ours), wheels)),
    ]
    theirs = [
        f"{one.name}__{ending}"
        for one in used
        for ending in LIBRARIES.values()
        if (one.libraries / f"lib{one.name}__{ending}.so").exists()
    ]
    theirs += [name for name in _RUNTIME if (wheels / f"lib{name}.so").exists()]
    own: list[str] = []
    made: dict[str, int] = {}

    def one(file: str, parts: Iterable[Path]) -> None:
        words = [
            *compiler.link,
            "-shared",
            *("-o", str(folder / file), f"-Wl,-soname,{file}"),
            *sorted(map(str, parts)),
            *common,
            "-Wl,--no-as-needed",
            *(f"-l{name}" for name in own),
            "-Wl,--as-needed",
            *(f"-l{name}" for name in theirs),
            "-s",
            *compiler.link_flags,
        ]
        _run(words, folder, f"linking {file}")
        made[file] = (folder / file).stat().st_size

    for library, ending in LIBRARIES.items():
        parts = [o for u, o in objects.items() if u.library == library and not u.is_module]
        one(f"lib{package}__{ending}.so", parts)
        own.append(f"{package}__{ending}")
    module = f"{package}_s__rosidl_typesupport_c{sysconfig.get_config_var('EXT_SUFFIX')}"
    one(module, [o for unit, o in objects.items() if unit.is_module])
    return made

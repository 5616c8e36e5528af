"""From compiled files to the five libraries and the module that Python loads."""

from __future__ import annotations

import sys
import sysconfig
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from actionkit._interfaces import compiler as compilers
from actionkit._interfaces.compiler import Compiler
from actionkit._interfaces.dependencies import Dependency
from actionkit._interfaces.generators import LIBRARIES
from actionkit._interfaces.objects import Unit
from actionkit._interfaces.wheel import Target

_RUNTIME = (
    "rosidl_runtime_c",
    "rosidl_typesupport_c",
    "rosidl_typesupport_fastrtps_c",
    "rosidl_typesupport_fastrtps_cpp",
    "rosidl_typesupport_introspection_c",
    "fastcdr",
    "rcutils",
)


def link(
    package: str,
    folder: Path,
    objects: Mapping[Unit, Path],
    dependencies: Iterable[Dependency],
    compiler: Compiler,
    target: Target,
) -> dict[str, int]:
    """Link a package's libraries.

    Args:
        package: The package's name.
        folder: Where the libraries go for now.
        objects: What was compiled.
        dependencies: All packages that are used.
        compiler: What links.
        target: Where the package goes.

    Returns:
        The names of the libraries with their sizes in bytes.

    Raises:
        InterfacesError: The linker fails.
    """
    used = list(dependencies)
    # rosidl_typesupport_c looks for two of the libraries by their names when a type is first
    # used. They are found because they are loaded already, so they are needed whatever the
    # linker thinks. The search path is the old kind, which counts more than LD_LIBRARY_PATH:
    # a package that was built again must not get the libraries of the installed one.
    search = ["$ORIGIN", *_where(used, target)]
    wheels = Path(sys.prefix, "lib")
    folders = [folder, *(one.libraries for one in used if one.record is not None), wheels]
    common = [
        "-Wl,--disable-new-dtags",
        # Not with -Wl, which takes a comma in a path for the end of it.
        *(word for path in search for word in ("-Xlinker", "-rpath", "-Xlinker", path)),
        *(f"-L{path}" for path in folders),
    ]
    theirs = [
        f"{one.name}__{ending}"
        for one in used
        for ending in LIBRARIES.values()
        if (one.libraries / f"lib{one.name}__{ending}.so").exists()
    ]
    own: list[str] = []
    made: dict[str, int] = {}

    def one(file: str, parts: Sequence[Path]) -> None:
        words = [
            *compiler.link,
            "-shared",
            *("-o", str(folder / file), f"-Wl,-soname,{file}"),
            *map(str, sorted(parts)),
            *common,
            "-Wl,--no-as-needed",
            *(f"-l{name}" for name in own),
            "-Wl,--as-needed",
            *(
                f"-l{name}"
                for name in (*theirs, *_RUNTIME)
                if name in theirs or _is_in(wheels, name)
            ),
            "-s",
            *compiler.link_flags,
        ]
        compilers.run(words, folder, f"linking {file}")
        made[file] = (folder / file).stat().st_size

    for library, ending in LIBRARIES.items():
        parts = [
            o for unit, o in objects.items() if unit.library == library and not _is_module(unit)
        ]
        one(f"lib{package}__{ending}.so", parts)
        own.append(f"{package}__{ending}")
    module = f"{package}_s__rosidl_typesupport_c{sysconfig.get_config_var('EXT_SUFFIX')}"
    one(module, [o for unit, o in objects.items() if _is_module(unit)])
    return made


def _is_module(unit: Unit) -> bool:
    return ".ep." in unit.files[0].name


def _is_in(folder: Path, name: str) -> bool:
    return (folder / f"lib{name}.so").exists()


def _where(used: Iterable[Dependency], target: Target) -> list[str]:
    """Return where libraries of packages of our own are: beside this one, or elsewhere."""
    return [
        str(one.libraries) if target.is_away(one) else f"$ORIGIN/../{one.name}"
        for one in used
        if one.record is not None
    ]

"""Makes the C++ types of a package that `actionkit interfaces build` has built for Python.

It uses rosidl's generators, which come with rclpy's wheels. They write to standard output, so this
runs as a program: `python -m tests.field.cpp_types FOLDER/NAME TARGET`.
"""

from __future__ import annotations

import importlib
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

_ARGUMENTS: dict[str, tuple[object, ...]] = {
    "rosidl_generator_cpp": (),
    "rosidl_typesupport_fastrtps_cpp": (),
    "rosidl_typesupport_introspection_cpp": (),
    "rosidl_typesupport_cpp": (
        ["rosidl_typesupport_fastrtps_cpp", "rosidl_typesupport_introspection_cpp"],
    ),
}
"""Generators, and the arguments of each beside a file; the last one uses those before it."""


def build(package: Path, target: Path) -> list[str]:
    """Write headers and libraries into a folder; return the words for a compiler that uses them."""
    words = [sys.executable, "-m", __name__, str(package), str(target)]
    subprocess.run(words, check=True, stdout=subprocess.DEVNULL)
    libraries = [*_ARGUMENTS][1:]
    flags = [*_flags(package, target), f"-L{target}"]
    *before, last = libraries
    running = [(name, _link(name, package, target, flags)) for name in before]
    _wait(running)
    flags += [f"-l{package.name}__{name}" for name in before]
    _wait([(last, _link(last, package, target, flags))])
    return [*flags, f"-l{package.name}__{last}"]


def _flags(package: Path, target: Path) -> list[str]:
    wheels = Path(sys.prefix)
    own = [*(target / name for name in _ARGUMENTS), package / "include"]
    others = [path for path in (wheels / "include").iterdir() if "python" not in path.name]
    return [
        *("g++", "-std=c++17", "-fPIC", "-shared"),
        *(f"-I{path}" for path in own),
        *(word for path in (wheels / "include", *others) for word in ("-isystem", str(path))),
        # Type support is found by name, if its library is loaded: so none is dropped as unused.
        *(f"-L{package}", f"-L{wheels / 'lib'}", "-Wl,--no-as-needed,--allow-shlib-undefined"),
        *(f"-Wl,-rpath,{path}" for path in (target, package)),
    ]


def _link(name: str, package: Path, target: Path, flags: list[str]) -> subprocess.Popen[bytes]:
    file = f"lib{package.name}__{name}.so"
    words = [*flags, "-O0", "-w", *map(str, (target / name).rglob("*.cpp")), "-o"]
    words += [str(target / file), f"-Wl,-soname,{file}", f"-l{package.name}__rosidl_generator_c"]
    used = json.loads((package / "actionkit_build.json").read_text())["uses"]
    words += [f"-l{other}__{name}" for other in used]
    return subprocess.Popen(words)


def _wait(running: list[tuple[str, subprocess.Popen[bytes]]]) -> None:
    failed = [name for name, process in running if process.wait() != 0]
    if failed:
        raise RuntimeError(f"could not be compiled: {failed}")


def _generate(package: Path, target: Path) -> None:
    share = package.parent / "share" / package.name
    idls = sorted(path.relative_to(share) for path in share.rglob("*.idl"))
    for name, more in _ARGUMENTS.items():
        resources = Path(sys.prefix, "share", name, "resource")
        output = target / name / package.name
        (output / "msg").mkdir(parents=True, exist_ok=True)
        job = {
            "package_name": package.name,
            "output_dir": str(output),
            "template_dir": str(resources),
            "idl_tuples": [f"{share}:{idl}" for idl in idls],
            "target_dependencies": [],
            "type_description_tuples": [
                f"{idl}:{(share / idl).with_suffix('.json')}" for idl in idls
            ],
        }
        arguments = target / f"{name}.json"
        arguments.write_text(json.dumps(job))
        generator: Any = importlib.import_module(name)
        generator.generate_cpp(str(arguments), *more)
        for template in resources.glob("*__visibility_control.h*.in"):
            text = template.read_text().replace("@PROJECT_NAME@", package.name)
            text = text.replace("@PROJECT_NAME_UPPER@", package.name.upper())
            (output / "msg" / template.stem).write_text(text)


if __name__ == "__main__":
    _generate(*map(Path, sys.argv[1:]))

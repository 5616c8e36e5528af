"""rosidl's generators, which come with rclpy's wheels: from .action files to C, C++ and Python."""

from __future__ import annotations

import contextlib
import copy
import importlib
import io
import json
import sys
import threading
import warnings
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from actionkit._interfaces.dependencies import Dependency
from actionkit._interfaces.errors import InterfacesError, MissingToolError
from actionkit._model.missing import RCLPY

LIBRARIES = {
    "c": "rosidl_generator_c",
    "fastrtps": "rosidl_typesupport_fastrtps_c",
    "introspection": "rosidl_typesupport_introspection_c",
    "dispatch": "rosidl_typesupport_c",
    "python": "rosidl_generator_py",
}
"""Folder of generated sources -> the ending of the library that is made from them, in an order in
which each needs only those before it. rosidl looks for some of them by these names."""
_VISIBILITY = ("generator_c", "typesupport_fastrtps_c", "typesupport_introspection_c")
_lock = threading.Lock()
"""The templates go through a global interpreter, and through standard output."""


def check_installed() -> None:
    """Import the generators.

    Raises:
        MissingToolError: One is not here.
    """
    for name in ("rosidl_adapter", "rosidl_generator_type_description", *LIBRARIES.values()):
        try:
            importlib.import_module(name)
        except ImportError as error:
            raise MissingToolError(
                f"{name}, a generator of ROS, cannot be imported here ({error})."
                f" It comes with rclpy: pip install {RCLPY}"
            ) from error


def generate(
    package: str, files: Iterable[Path], dependencies: Iterable[Dependency], work: Path
) -> None:
    """Write the sources of a package's libraries and its Python modules.

    Args:
        package: The package's name.
        files: Its .msg, .srv and .action files, relative to `work/source`, where they have to be.
        dependencies: All packages that these use, with those that they use in turn.
        work: A folder. Below it come `idl` and `hashes` (files for `share`), and a folder for
            each of `LIBRARIES`.

    Raises:
        InterfacesError: A generator fails; the text has what it wrote.
    """
    with _lock, _parsing_once(), _quiet() as written:
        try:
            _generate(package, sorted(files), list(dependencies), work)
        except (Exception, SystemExit) as error:
            tail = "\n".join(written.getvalue().strip().splitlines()[-5:])
            raise InterfacesError(
                f"{package}: a generator of ROS failed: {type(error).__name__}: {error}\n{tail}"
            ) from error


def _generate(package: str, files: list[Path], dependencies: list[Dependency], work: Path) -> None:
    convert_to_idl: Any = importlib.import_module("rosidl_adapter").convert_to_idl
    idl, source = work / "idl", work / "source"
    for file in files:
        convert_to_idl(source, package, file, idl)
    idls = [file.with_suffix(".idl").as_posix() for file in files]

    def run(generator: str, folder: str, function: str, *more: object, **options: object) -> None:
        output = work / folder / package
        output.mkdir(parents=True, exist_ok=True)
        arguments = work / f"{generator}.json"
        arguments.write_text(
            json.dumps(
                {
                    "package_name": package,
                    "output_dir": str(output),
                    "template_dir": str(_resources(generator)),
                    "idl_tuples": [f"{idl}:{name}" for name in idls],
                    "target_dependencies": [],
                    **options,
                }
            )
        )
        getattr(importlib.import_module(generator), function)(str(arguments), *more)

    run(
        "rosidl_generator_type_description",
        "hashes",
        "generate_type_hash",
        include_paths=[f"{one.name}:{one.share}" for one in dependencies],
    )
    hashes = work / "hashes" / package
    run(
        "rosidl_generator_c",
        "c",
        "generate_c",
        type_description_tuples=[f"{name}:{(hashes / name).with_suffix('.json')}" for name in idls],
        ros_interface_files=[str(source / file) for file in files],
    )
    run("rosidl_typesupport_fastrtps_c", "fastrtps", "generate_typesupport_fastrtps_c")
    run("rosidl_typesupport_introspection_c", "introspection", "generate_c")
    kinds = ["rosidl_typesupport_fastrtps_c", "rosidl_typesupport_introspection_c"]
    run("rosidl_typesupport_c", "dispatch", "generate_c", kinds)
    run("rosidl_generator_py", "python", "generate_py", ["rosidl_typesupport_c"])
    for kind in _VISIBILITY:
        name = f"rosidl_{kind}__visibility_control.h"
        template = (_resources(f"rosidl_{kind}") / f"{name}.in").read_text("utf-8")
        text = template.replace("@PROJECT_NAME@", package)
        header = work / "c" / package / "msg" / name
        header.parent.mkdir(exist_ok=True)
        header.write_text(text.replace("@PROJECT_NAME_UPPER@", package.upper()), "utf-8")


def _resources(generator: str) -> Path:
    return Path(sys.prefix, "share", generator, "resource")


@contextlib.contextmanager
def _parsing_once() -> Iterator[None]:
    """Parse each .idl file once, and not once for each generator: that is half of all the time."""
    parser: Any = importlib.import_module("rosidl_parser.parser")
    parse = parser.parse_idl_string
    parsed: dict[str, Any] = {}

    def parse_once(text: str, *args: Any, **options: Any) -> Any:
        if text not in parsed:
            parsed[text] = parse(text, *args, **options)
        return copy.deepcopy(parsed[text])

    parser.parse_idl_string = parse_once
    try:
        yield
    finally:
        parser.parse_idl_string = parse


@contextlib.contextmanager
def _quiet() -> Iterator[Any]:
    written = io.StringIO()
    with (
        contextlib.redirect_stdout(written),
        contextlib.redirect_stderr(written),
        warnings.catch_warnings(),
    ):
        warnings.simplefilter("ignore")  # of backslashes in comments
        # empy 3 puts itself in front of the standard output that it finds first, and refuses to
        # work where another takes its place: have it begin anew.
        interpreter: Any = importlib.import_module("em").Interpreter
        if hasattr(interpreter, "_wasProxyInstalled"):
            interpreter._wasProxyInstalled = False
        yield written

"""Runs rosidl's generators, which make C, C++ and Python from .action files.

They come with rclpy's wheels. They keep their state in global variables and write to standard
output, so each runs in its own process, all at the same time. For each type they read every
template again, character by character; `_remember` caches this, which takes half of the time.
"""

from __future__ import annotations

import copy
import importlib
import json
import pickle
import sys
import warnings
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from actionkit._interfaces import processes
from actionkit._interfaces.dependencies import Dependency
from actionkit._interfaces.errors import MissingToolError
from actionkit._interfaces.processes import Progress
from actionkit._interfaces.source_tree import Package
from actionkit._model.missing import RCLPY

LIBRARIES: dict[str, tuple[object, ...]] = {
    "rosidl_generator_c": ("generate_c",),
    "rosidl_typesupport_fastrtps_c": ("generate_typesupport_fastrtps_c",),
    "rosidl_typesupport_introspection_c": ("generate_c",),
    "rosidl_typesupport_c": (
        "generate_c",
        ["rosidl_typesupport_fastrtps_c", "rosidl_typesupport_introspection_c"],
    ),
    "rosidl_generator_py": ("generate_py", ["rosidl_typesupport_c"]),
}
"""Generator -> its function and more arguments for it. The names of a package's libraries end with
the generators' names (rosidl searches for some); each library needs only those before it."""
HASHES = "rosidl_generator_type_description"
_PARSED = "parsed.pickle"
_PROGRAM = """
import json, sys
sys.path[:] = json.loads(sys.argv[1])
from actionkit._interfaces import generators
generators.{}(*map(json.loads, sys.argv[2:]))
"""


def check_installed() -> None:
    """Raise a `MissingToolError` if a generator is not installed."""
    for name in ("rosidl_adapter", HASHES, *LIBRARIES):
        try:
            importlib.import_module(name)
        except ImportError as error:
            raise MissingToolError(
                f"{name}, a generator of ROS, cannot be imported here ({error})."
                f" It comes with rclpy: pip install {RCLPY}"
            ) from error


def generate(package: Package, used: Iterable[Dependency], work: Path, progress: Progress) -> None:
    """Write the sources of a package's libraries and its Python modules.

    They are in `work`: the folders `idl` and `HASHES` (for `share`), and one for each of
    `LIBRARIES`.
    """
    for file in package.files:
        path = work / "source" / file.path
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(file.text, "utf-8")
    given = [package.name, str(work), sorted(file.path.as_posix() for file in package.files)]
    _run("describe", *given, [f"{one.name}:{one.share}" for one in used])
    libraries = list(reversed(LIBRARIES))  # Python takes longest
    processes.each(lambda library: _run("write", *given, library), libraries, progress)
    headers = work / "rosidl_generator_c" / package.name / "msg"
    headers.mkdir(exist_ok=True)
    for library in LIBRARIES:
        for template in _resources(library).glob("*__visibility_control.h.in"):
            text = template.read_text("utf-8").replace("@PROJECT_NAME@", package.name)
            text = text.replace("@PROJECT_NAME_UPPER@", package.name.upper())
            (headers / template.stem).write_text(text, "utf-8")


def _run(function: str, *arguments: object) -> None:
    words = [sys.executable, "-c", _PROGRAM.format(function)]
    words += map(json.dumps, [sys.path, *arguments])
    processes.run(words, f"{arguments[0]}: a generator of ROS failed", Path())


# --- in a generator's own process -----------------------------------------------------------


def describe(package: str, folder: str, names: list[str], paths: list[str]) -> None:
    """Write .idl files and the hashes of the types, and save the parsed types."""
    warnings.simplefilter("ignore")  # of backslashes in comments
    convert_to_idl: Any = importlib.import_module("rosidl_adapter").convert_to_idl
    work, parsed = Path(folder), _parse_once({})
    for name in names:
        convert_to_idl(work / "source", package, Path(name), work / "idl")
    _call(HASHES, package, work, names, include_paths=paths)
    (work / _PARSED).write_bytes(pickle.dumps(parsed))


def write(package: str, folder: str, names: list[str], library: str) -> None:
    """Write the sources of one library."""
    work = Path(folder)
    _parse_once(pickle.loads((work / _PARSED).read_bytes()))
    _remember()
    options = {}
    if library == "rosidl_generator_c":
        hashes = work / HASHES / package
        described = [f"{idl}:{(hashes / idl).with_suffix('.json')}" for idl in _idls(names)]
        sources = [str(work / "source" / name) for name in names]
        options = {"type_description_tuples": described, "ros_interface_files": sources}
    _call(library, package, work, names, **options)


def _call(generator: str, package: str, work: Path, names: list[str], **options: object) -> None:
    """Call a generator with a file of its arguments."""
    output, path = work / generator / package, work / f"{generator}.json"
    output.mkdir(parents=True)
    job = {
        "package_name": package,
        "output_dir": str(output),
        "template_dir": str(_resources(generator)),
        "idl_tuples": [f"{work / 'idl'}:{name}" for name in _idls(names)],
        "target_dependencies": [],
        **options,
    }
    path.write_text(json.dumps(job), "utf-8")
    function, *arguments = LIBRARIES.get(generator, ("generate_type_hash",))
    getattr(importlib.import_module(generator), str(function))(str(path), *arguments)


def _idls(names: Iterable[str]) -> list[str]:
    return [Path(name).with_suffix(".idl").as_posix() for name in names]


def _resources(generator: str) -> Path:
    return Path(sys.prefix, "share", generator, "resource")


def _parse_once(parsed: dict[str, Any]) -> dict[str, Any]:
    """Make the parser parse each .idl text only once; return the cache."""
    parser: Any = importlib.import_module("rosidl_parser.parser")
    parse = parser.parse_idl_string

    def parse_once(text: str, *args: Any, **options: Any) -> Any:
        if text not in parsed:
            parsed[text] = parse(text, *args, **options)
        return copy.deepcopy(parsed[text])

    parser.parse_idl_string = parse_once
    return parsed


def _remember() -> None:
    """Make empy search only once for the end of each expression in a template.

    The result of the two methods depends only on the text and the position in it.
    """
    scanner: Any = getattr(importlib.import_module("em"), "Scanner", None)
    for name in ("complex", "next"):
        if hasattr(scanner, name):  # another version of empy may not have these methods
            setattr(scanner, name, _remembering(getattr(scanner, name)))


def _remembering(find: Callable[..., Any]) -> Callable[..., Any]:
    known: dict[tuple[object, ...], tuple[Any, Exception | None]] = {}

    def found(scanner: Any, *args: Any, **options: Any) -> Any:
        place = getattr(scanner, "head", 0) + scanner.pointer  # empy 3 has no head
        key = (scanner.buffer, place, args, *options.items())
        if key not in known:
            try:
                known[key] = (find(scanner, *args, **options), None)
            except Exception as problem:  # noqa: BLE001  "no end was found" is remembered, too
                known[key] = (None, problem)
        value, error = known[key]
        if error is not None:
            raise error.with_traceback(None)
        return value

    return found

"""What is wrong with packages, found before anything is generated."""

from __future__ import annotations

import importlib
import importlib.util
import os
import sys
from collections.abc import Collection, Iterable, Mapping
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

from actionkit._interfaces.dependencies import Dependency, packages_with_message, read_record
from actionkit._interfaces.errors import BadSourceError, TargetError
from actionkit._interfaces.interface_file import InterfaceFile, Use, another_type
from actionkit._interfaces.selection import Read, without
from actionkit._interfaces.source_tree import Package
from actionkit._interfaces.wheel import owner_of
from actionkit._model.ros_packages import how_to_get, joined
from actionkit._model.similar_names import similar_names


def no_ros_installation(ours: Iterable[Path]) -> None:
    """Refuse beside an installed ROS, whose packages colcon makes.

    Raises:
        TargetError: One is sourced.
    """
    prefixes = [Path(p) for p in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if p]
    mine = {Path(sys.prefix), *ours}
    for prefix in prefixes:
        if prefix not in mine and not any(prefix.glob("*/actionkit_build.json")):
            raise TargetError(
                f"a ROS 2 installation is sourced here ({prefix}, by AMENT_PREFIX_PATH). There"
                " `colcon build` makes interface packages, for C++ and all other programs too."
                " This command is for rclpy from PyPI: use it in a shell where no ROS is sourced"
            )


def files(package: Package, read: Iterable[InterfaceFile]) -> None:
    """Refuse files that cannot be right.

    Raises:
        BadSourceError: The text has one line for each problem.
    """
    snake = importlib.import_module("rosidl_pycommon").convert_camel_case_to_lower_case_underscore
    found = list(read)
    problems = [problem for file in found for problem in file.problems]
    modules: dict[tuple[str, str], InterfaceFile] = {}
    for file in found:
        other = modules.setdefault((file.path.suffix, snake(file.path.stem)), file)
        if other is not file:
            problems.append(
                f"{package.folder / file.path}: its module would be called as that of"
                f" {other.path.name}: rename one of them"
            )
    _raise(problems)


def types(
    package: Package,
    read: Iterable[InterfaceFile],
    dependencies: Mapping[str, Dependency],
) -> None:
    """Refuse fields of types that are not there, and messages that hold themselves.

    Raises:
        BadSourceError: The text has one line for each problem.
    """
    found = list(read)
    own = {file.path.stem for file in found if file.path.suffix == ".msg"}
    problems = []
    inside: dict[str, set[str]] = {name: set() for name in own}
    for file in found:
        for use in file.uses:
            if use.package != package.name:
                problems += _foreign_type(use, dependencies[use.package])
            elif use.name not in own:
                problems.append(f"{use.place}: {_own_type(package, use, own)}")
            elif file.path.suffix == ".msg":
                inside[file.path.stem].add(use.name)
    _raise(problems)
    if circle := _circle(inside):
        _raise([f"{package.folder}: messages hold each other without an end: {circle}"])


def _own_type(package: Package, use: Use, own: set[str]) -> str:
    text = f"there is no message {use.name!r} in {package.name}"
    if (other := another_type(use.name)) is not None:
        return f"{text}: use {other}"
    if near := similar_names(use.name, sorted(own)):
        return f"{text}. Did you mean {' or '.join(near)}?"
    if elsewhere := packages_with_message(use.name):
        return f"{text}: write {elsewhere[0]}/{use.name}"
    return f"{text}: add msg/{use.name}.msg, or write the package before it"


def _foreign_type(use: Use, dependency: Dependency) -> list[str]:
    if dependency.has_message(use.name):
        return []
    near = similar_names(use.name, dependency.messages())
    hint = f" Did you mean {' or '.join(near)}?" if near else ""
    return [f"{use.place}: there is no message {use.name!r} in {use.package}.{hint}"]


def missing(read: Read, names: Collection[str]) -> None:
    """Refuse packages that use others which are not here: all of them at once.

    Raises:
        BadSourceError: There are such packages; the text has one line.
    """
    if not names:
        return
    uses = [use for files in read.values() for file in files for use in file.uses]
    first = next((f"{use.place}: " for use in uses if use.package in names), "")
    are = "package {} is" if len(names) == 1 else "packages {} are"
    told = are.format(joined(sorted(names)))
    steps = how_to_get(names)
    if (free := without(read, names)) is not None:
        steps[-1] += f"; or build only what works without: --only {free}"
    _raise([f"{first}the {told} not here: {'. '.join(steps)}"])


def order(packages: Mapping[str, set[str]]) -> list[str]:
    """Return the packages so that each comes after those that it uses.

    Raises:
        BadSourceError: There is no such order; the text names a circle.
    """
    if circle := _circle(packages):
        _raise([f"packages use each other's types in a circle, and none can be first: {circle}"])
    return [name for name in TopologicalSorter(packages).static_order() if name in packages]


def _circle(graph: Mapping[str, set[str]]) -> str:
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return " -> ".join(reversed(error.args[1]))
    return ""


def name(package: Package, folder: Path) -> None:
    """Refuse to take the place, or the name, of a package that somebody else made.

    Raises:
        TargetError: It would.
    """
    place = folder / package.name
    if read_record(place) is not None:
        return
    owner = None
    if place.exists() or place.is_symlink():  # the latter without what it leads to
        owner = owner_of(package.name) if (place / "__init__.py").is_file() else None
        if owner is None:
            raise TargetError(
                f"{place}: this is here, and was not built by `actionkit interfaces build`: it is"
                " left alone. Choose another folder with -o"
            )
    spec = importlib.util.find_spec(package.name)
    if owner is not None:
        how = f"is installed here, by {owner}"
    elif package.name in sys.stdlib_module_names:
        how = "is a module of Python itself"
    elif spec is None or spec.origin is None or read_record(Path(spec.origin).parent) is not None:
        return
    else:
        how = f"is installed here ({Path(spec.origin).parent})"
    raise TargetError(
        f"{package.folder / 'package.xml'}: a package {package.name!r} {how}: two of one name"
        " cannot be imported. Choose another <name>"
    )


def _raise(problems: list[str]) -> None:
    if problems:
        raise BadSourceError("\n".join(problems))

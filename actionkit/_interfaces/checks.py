"""Finds mistakes in packages before anything is generated.

Mistakes in the sources raise one `BadSourceError`, with a line for each.
"""

from __future__ import annotations

import importlib
import importlib.util
import os
import sys
from collections.abc import Collection, Iterable, Mapping
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

from actionkit._interfaces.dependencies import RECORD, Dependency, read_record
from actionkit._interfaces.errors import BadSourceError, InterfacesError
from actionkit._interfaces.interface_file import Use
from actionkit._interfaces.lines import OTHER_LANGUAGES
from actionkit._interfaces.selection import without
from actionkit._interfaces.source_tree import Package
from actionkit._model.ros_packages import how_to_get, joined
from actionkit._model.similar_names import similar_names


def no_ros_installation(ours: Path) -> None:
    """Refuse to build beside an installed ROS: there, colcon builds packages."""
    for prefix in filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)):
        is_ours = any(Path(prefix).glob(f"*/{RECORD}"))
        if not is_ours and Path(prefix) not in (Path(sys.prefix), ours):
            raise InterfacesError(
                f"a ROS 2 installation is sourced here ({prefix}, by AMENT_PREFIX_PATH). There"
                " `colcon build` makes interface packages, for C++ and all other programs too."
                " This command is for rclpy from PyPI: use it in a shell where no ROS is sourced"
            )


def name(package: Package, folder: Path) -> None:
    """Refuse to overwrite a package that somebody else made, or to take its name."""
    place = folder / package.name
    if read_record(place) is not None:
        return
    spec = importlib.util.find_spec(package.name)
    found = None if spec is None or spec.origin is None else Path(spec.origin).parent
    if found is not None and read_record(found) is None:
        is_python = package.name in sys.stdlib_module_names
        how = "is a module of Python itself" if is_python else f"is installed here ({found})"
        raise InterfacesError(
            f"{package.folder / 'package.xml'}: a package {package.name!r} {how}: two of one name"
            " cannot be imported. Choose another <name>"
        )
    if place.exists() or place.is_symlink():  # also a link to nothing
        raise InterfacesError(
            f"{place}: this is here, and was not built by `actionkit interfaces build`: it is left"
            " alone. Choose another folder with -o"
        )


def files(package: Package) -> None:
    """Refuse files that cannot be right."""
    snake = importlib.import_module("rosidl_pycommon").convert_camel_case_to_lower_case_underscore
    problems = [problem for file in package.files for problem in file.problems]
    modules: dict[tuple[str, str], Path] = {}
    for path in (file.path for file in package.files):
        other = modules.setdefault((path.suffix, snake(path.stem)), path)
        if other is not path:
            problems.append(
                f"{package.folder / path}: its module would be called as that of {other.name}:"
                " rename one of them"
            )
    _raise(problems)


def types(package: Package, used: Mapping[str, Dependency]) -> None:
    """Refuse fields of unknown types, and messages that contain themselves."""
    messages = {file.path.stem: file for file in package.files if file.kind == "msg"}
    problems = []
    for use in (use for file in package.files for use in file.uses):
        is_own = use.package == package.name
        there = sorted(messages) if is_own else used[use.package].messages()
        if use.name not in there:
            problems.append(_no_message(use, there, is_own))
    _raise(problems)
    inside = {
        name: {use.name for use in file.uses if use.package == package.name}
        for name, file in messages.items()
    }
    if circle := _circle(inside):
        _raise([f"{package.folder}: messages hold each other without an end: {circle}"])


def _no_message(use: Use, there: list[str], is_own: bool) -> str:
    text = f"{use.place}: there is no message {use.name!r} in {use.package}"
    if use.name in OTHER_LANGUAGES:
        return f"{text}: use {OTHER_LANGUAGES[use.name]}"
    if near := similar_names(use.name, there):
        return f"{text}. Did you mean {' or '.join(near)}?"
    if elsewhere := sorted(Path(sys.prefix, "share").glob(f"*/msg/{use.name}.idl")):
        return f"{text}: write {elsewhere[0].parents[1].name}/{use.name}"
    here = f": add msg/{use.name}.msg, or write the package before it"
    return f"{text}{here if is_own else ''}"


def missing(packages: Mapping[str, Package], names: Collection[str]) -> None:
    """Refuse if packages that are used are not here; one line lists all of them."""
    if not names:
        return
    uses = [use for one in packages.values() for file in one.files for use in file.uses]
    steps = how_to_get(names)
    if (free := without(packages, names)) is not None:
        steps.append(f"Or build single types that do not need them, such as --only {free}")
    # Several packages have no common place.
    place = next((use.place for use in uses if names == {use.package}), joined(sorted(packages)))
    missing = f"the package{'s' if len(names) > 1 else ''} {joined(sorted(names))}"
    _raise([f"{place}: {missing} cannot be found here. {'. '.join(steps)}"])


def order(packages: Iterable[Package]) -> list[Package]:
    """Return the packages, each after those that it uses; refuse circles."""
    by_name = {package.name: package for package in packages}
    uses = {name: package.uses() & set(by_name) for name, package in by_name.items()}
    if circle := _circle(uses):
        _raise([f"packages use each other's types in a circle, and none can be first: {circle}"])
    return [by_name[name] for name in TopologicalSorter(uses).static_order()]


def _circle(graph: Mapping[str, set[str]]) -> str:
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return " -> ".join(reversed(error.args[1]))
    return ""


def _raise(problems: list[str]) -> None:
    if problems:
        raise BadSourceError("\n".join(problems))

"""Finds the message, service and action classes of packages, and of the packages they use."""

from __future__ import annotations

import importlib
import importlib.util
import sys
from collections.abc import Callable, Collection
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

Comments = Callable[[str], tuple[list[str], dict[str, list[str]]]]
"""Type name, such as `test_msgs/action/Fibonacci_Goal` -> its comment lines, and each field's."""
_MARKS = {"msg": "SLOT_TYPES", "srv": "Request", "action": "Goal"}
"""Kind -> an attribute that only types of that kind have, and not their parts."""


class NoSuchPackageError(Exception):
    """A package is not installed here, or has no messages, services and actions."""


@dataclass
class Package:
    """The classes of one installed package, by kind (`msg`, `srv`, `action`) and name, sorted."""

    name: str
    folder: Path
    types: dict[str, dict[str, Any]] = field(default_factory=dict)
    parts: dict[str, list[str]] = field(default_factory=dict)  # such as `GetMap_Request`


class Loaded:
    """Packages, and the packages that they use: these are found while stubs are written."""

    def __init__(self, names: Collection[str], comments: Comments) -> None:
        """Load packages, or raise a `NoSuchPackageError`."""
        self.packages: list[Package] = []  # `has` adds to it, also during an iteration
        self.problems: list[str] = []  # what could not be loaded; all the rest is there
        self.comments = comments
        self._known: dict[str, Package | None] = {}
        for name in names:
            self._add(name)

    def has(self, user: str, package: str, kind: str, name: str) -> bool:
        """Return whether a type, or a part of one, exists; `user` is the package that uses it."""
        try:
            self._add(package)
        except NoSuchPackageError as error:
            self._known[package] = None
            self.problems.append(f"{error} {user} uses it: there its types are `Any`.")
        found = self._known[package]
        types = {} if found is None else found.types.get(kind, {})
        return name in types or name.partition("_")[0] in types

    def _add(self, name: str) -> None:
        if name not in self._known:
            package = self._known[name] = _package(name, self.problems)
            self.packages.append(package)


def installed() -> list[str]:
    """Return the names of interface packages that seem to be installed, without importing them."""
    patterns = [f"*/{kind}/__init__.py" for kind in _MARKS]
    found = (path for entry in sys.path for one in patterns for path in Path(entry).glob(one))
    return sorted({path.parts[-3] for path in found})


def folder_of(name: str) -> Path | None:
    """Return where Python would import a package from."""
    try:
        spec = importlib.util.find_spec(name) if name.isidentifier() else None
    except ValueError:  # as for `__main__`
        return None
    places = None if spec is None else spec.submodule_search_locations
    return Path(next(iter(places))) if places else None


def _package(name: str, problems: list[str]) -> Package:
    folder = folder_of(name)
    if folder is None:
        raise NoSuchPackageError(f"There is no package {name!r} here that could be imported.")
    package = Package(name, folder)
    for kind, mark in _MARKS.items():
        module = f"{name}.{kind}"
        if not (folder / kind / "__init__.py").is_file():
            continue
        try:
            found = sorted(vars(importlib.import_module(module)).items())
        except Exception as error:  # noqa: BLE001  the package's own code runs here
            problems.append(f"{module} cannot be imported ({type(error).__name__}: {error}).")
            continue
        classes = {
            n: value
            for n, value in found
            if isinstance(value, type) and value.__module__.startswith(f"{module}.")
        }
        if types := {n: cls for n, cls in classes.items() if hasattr(cls, mark)}:
            package.types[kind] = types
            package.parts[kind] = [n for n in classes if n not in types]
    if not package.types:
        raise NoSuchPackageError(
            f"The package {name!r} has no messages, services or actions that could be imported."
        )
    return package

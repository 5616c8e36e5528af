"""Finds the message, service and action classes of packages, and of those that they use."""

from __future__ import annotations

import ast
import importlib
import importlib.util
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import ModuleType
from typing import Any

KINDS = ("msg", "srv", "action")
_PARTS = {"msg": (), "srv": ("Request",), "action": ("Goal", "Result", "Feedback")}
"""What a class must have to be a type of that kind."""


class NoSuchPackageError(Exception):
    """A package is not installed here, or has no messages, services and actions."""


@dataclass
class Package:
    """The classes of one installed package.

    Attributes:
        name: Such as `geometry_msgs`.
        folder: Where it is installed.
        types: Kind (`msg`, `srv`, `action`) -> name -> class, in the order of the names.
        extras: Kind -> other names that its module hands on, such as `GetMap_Request` -> class.
        others: Modules that have nothing to do with types, such as `message_fixtures`.
    """

    name: str
    folder: Path
    types: dict[str, dict[str, Any]] = field(default_factory=dict)
    extras: dict[str, dict[str, Any]] = field(default_factory=dict)
    others: list[str] = field(default_factory=list)


@dataclass
class Loaded:
    """Packages, with all that they use.

    Attributes:
        packages: Name -> package.
        problems: Sentences on what could not be had; all the rest is there.
        comments: Of `test_msgs/action/Fibonacci_Goal` or another message: the lines of comment on
            it, and those on each field.
    """

    packages: dict[str, Package] = field(default_factory=dict)
    problems: list[str] = field(default_factory=list)
    comments: Callable[[str], tuple[list[str], dict[str, list[str]]]] = lambda name: ([], {})

    def has(self, package: str, kind: str, name: str) -> bool:
        """Tell whether there is such a type, or such a part of one."""
        found = self.packages.get(package)
        types = {} if found is None else found.types.get(kind, {})
        return name in types or name.partition("_")[0] in types


def load(names: list[str]) -> Loaded:
    """Return packages and all that their types use.

    Raises:
        NoSuchPackageError: One of `names` is no interface package that is installed here.
    """
    loaded = Loaded()
    waiting = [(name, "") for name in names]
    while waiting:
        name, user = waiting.pop(0)
        if name in loaded.packages:
            continue
        try:
            package = _package(name, loaded.problems)
        except NoSuchPackageError as error:
            if not user:
                raise
            problem = f"{error} {user} uses it: there its types are `Any`."
            if problem not in loaded.problems:
                loaded.problems.append(problem)
            continue
        loaded.packages[name] = package
        waiting += [(used, name) for used in sorted(_used(package))]
    return loaded


def installed() -> list[str]:
    """Return the names of the interface packages that seem to be installed; none is imported."""
    return sorted(
        {
            init.parts[-3]
            for entry in sys.path
            for kind in KINDS
            for init in Path(entry or ".").glob(f"*/{kind}/__init__.py")
        }
    )


def messages(kind: str, cls: Any) -> Iterator[Any]:
    """Yield the message classes of a type: itself, or those that it is made of."""
    if kind == "msg":
        yield cls
    elif kind == "srv":
        for part in ("Request", "Response", "Event"):
            if hasattr(cls, part):
                yield getattr(cls, part)
    else:
        yield from (cls.Goal, cls.Result, cls.Feedback)
        for service in (cls.Impl.SendGoalService, cls.Impl.GetResultService):
            yield from messages("srv", service)
        yield cls.Impl.FeedbackMessage


def used_types(message: Any) -> Iterator[tuple[str, str, str]]:
    """Yield package, kind and name of each type that the fields of a message have."""
    from rosidl_parser.definition import AbstractNestedType, NamespacedType

    for slot in message.SLOT_TYPES:
        item = slot.value_type if isinstance(slot, AbstractNestedType) else slot
        if isinstance(item, NamespacedType):
            package, kind = item.namespaces
            yield package, kind, item.name


def _used(package: Package) -> set[str]:
    used = {
        found
        for kind, types in package.types.items()
        for cls in types.values()
        for message in messages(kind, cls)
        for found, _, _ in used_types(message)
    }
    if package.types.get("action"):
        used.add("action_msgs")  # the services and topics that every action has
    return used - {package.name}


def _package(name: str, problems: list[str]) -> Package:
    try:
        spec = importlib.util.find_spec(name) if name.isidentifier() else None
    except (ImportError, ValueError):
        spec = None
    if spec is None or not spec.submodule_search_locations:
        raise NoSuchPackageError(f"There is no package {name!r} here that could be imported.")
    package = Package(name, Path(next(iter(spec.submodule_search_locations))))
    for kind in KINDS:
        try:
            below = importlib.util.find_spec(f"{name}.{kind}")
        except Exception as error:  # noqa: BLE001  the package's own code runs here
            problems.append(f"{name} cannot be imported ({type(error).__name__}: {error}).")
            break
        if below is None or below.origin is None:
            continue
        found = _classes(below, kind, problems)
        types = {n: c for n, c in found.items() if _is_type(kind, c)}
        if types:
            package.types[kind] = dict(sorted(types.items()))
            package.extras[kind] = dict(sorted((n, c) for n, c in found.items() if n not in types))
    if not package.types:
        raise NoSuchPackageError(
            f"The package {name!r} has no messages, services or actions that could be imported."
        )
    package.others = sorted(
        path.stem
        for path in package.folder.glob("*.py")
        if path.stem.isidentifier() and not path.stem.startswith("_")
    )
    return package


def _is_type(kind: str, cls: Any) -> bool:
    return hasattr(cls, "SLOT_TYPES") == (kind == "msg") and all(
        hasattr(cls, part) for part in _PARTS[kind]
    )


def _classes(spec: ModuleSpec, kind: str, problems: list[str]) -> dict[str, Any]:
    """Return the classes that the module of a kind hands on, by name."""
    try:
        module = importlib.import_module(spec.name)
    except Exception:  # noqa: BLE001  one broken type breaks the module of all
        return _one_by_one(spec, problems)
    return {
        name: value
        for name, value in vars(module).items()
        if isinstance(value, type) and value.__module__.startswith(f"{spec.name}.")
    }


def _one_by_one(spec: ModuleSpec, problems: list[str]) -> dict[str, Any]:
    """Import the modules of single types, with an empty one in place of that of all."""
    found: dict[str, Any] = {}
    before = set(sys.modules)
    stand_in = ModuleType(spec.name)
    stand_in.__path__ = list(spec.submodule_search_locations or ())
    sys.modules[spec.name] = stand_in
    try:
        for module, name in _handed_on(spec):
            try:
                found[name] = getattr(importlib.import_module(module), name)
            except Exception as error:  # noqa: BLE001  whatever a broken module raises
                problems.append(
                    f"{module} cannot be imported ({type(error).__name__}: {error}), so there are"
                    f" no types for {name}; nor can {spec.name} be imported as it is."
                )
    finally:
        # Nobody else may find the stand-in, or what was imported below it.
        for module in set(sys.modules) - before | {spec.name}:
            if module == spec.name or module.startswith(f"{spec.name}."):
                sys.modules.pop(module, None)
    return found


def _handed_on(spec: ModuleSpec) -> Iterator[tuple[str, str]]:
    """Yield module and name of each class that the module of a kind imports."""
    tree = ast.parse(Path(str(spec.origin)).read_text("utf-8"))
    for node in tree.body:
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith(f"{spec.name}."):
            for alias in node.names:
                yield str(node.module), alias.name

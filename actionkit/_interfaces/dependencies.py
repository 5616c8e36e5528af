"""The packages whose types a package uses: where they are, and what they use themselves."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from actionkit._interfaces.build_record import BuildRecord, read_record

IMPLIED = {
    "msg": frozenset[str](),
    "srv": frozenset({"service_msgs", "builtin_interfaces"}),
    "action": frozenset(
        {"action_msgs", "unique_identifier_msgs", "builtin_interfaces", "service_msgs"}
    ),
}
"""What the types of each kind use without naming it."""
_INCLUDE = re.compile(r'#include "(\w+)/')


@dataclass(frozen=True)
class Dependency:
    """A package that is there already.

    Attributes:
        name: The package.
        share: Its folder of .idl, .msg and .json files.
        include: The folder of its C headers.
        libraries: The folder of its libraries.
        record: How it was built, if it was by us.
    """

    name: str
    share: Path
    include: Path
    libraries: Path
    record: BuildRecord | None

    def has_message(self, name: str) -> bool:
        return (self.share / "msg" / f"{name}.idl").is_file()

    def messages(self) -> list[str]:
        return sorted(path.stem for path in (self.share / "msg").glob("*.idl"))

    def uses(self) -> set[str]:
        if self.record is not None:
            return set(self.record.uses)
        texts = (path.read_text("utf-8") for path in self.share.glob("*/*.idl"))
        return {name for text in texts for name in _INCLUDE.findall(text)} - {self.name}


def find(name: str, target: Path) -> Dependency | None:
    """Return the package that Python would import, what was built into `target` before others."""
    for entry in (target, *map(Path, sys.path)):
        folder = entry / name
        record = read_record(folder)
        if record is not None:
            share = (folder / record.share).resolve()
            return Dependency(name, share, folder / "include", folder, record)
        if (folder / "__init__.py").is_file():
            break  # as installed, by a wheel of ROS
    prefix = Path(sys.prefix)
    if not (prefix / "share" / name / "package.xml").is_file():
        return None
    return Dependency(
        name, prefix / "share" / name, prefix / "include" / name, prefix / "lib", None
    )


def with_all_they_use(names: Iterable[str], target: Path) -> dict[str, Dependency | None]:
    """Return the packages and those that they use in turn; `None` for one that is not there."""
    found: dict[str, Dependency | None] = {}
    left = set(names)
    while left:
        name = left.pop()
        dependency = found[name] = find(name, target)
        if dependency is not None:
            left |= dependency.uses() - set(found)
    return dict(sorted(found.items()))


def packages_with_message(name: str) -> list[str]:
    """Return the names of installed packages that have a message of that name."""
    found = Path(sys.prefix, "share").glob(f"*/msg/{name}.idl")
    return sorted(path.parents[1].name for path in found)

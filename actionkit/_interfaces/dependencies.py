"""Finds the packages that a package uses, and the packages that these use in turn."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path

RECORD = "actionkit_build.json"
"""The file beside the libraries of a built package."""
_INCLUDE = re.compile(r'#include "(\w+)/')


@dataclass(frozen=True)
class BuildRecord:
    """What a file beside a built package says about its build."""

    name: str
    version: str
    key: str  # the hash of everything that it was made from
    uses: list[str]  # the packages with types that it uses, and those that these use
    libraries: dict[str, int]  # with their sizes in bytes

    def write(self, folder: Path) -> None:
        (folder / RECORD).write_text(json.dumps(asdict(self), indent=1) + "\n", "utf-8")

    def is_complete(self, folder: Path) -> bool:
        """Return whether all libraries that were built are still there."""
        return _share(folder) is not None and libraries_in(folder) == self.libraries


def libraries_in(folder: Path) -> dict[str, int]:
    """Return the libraries of a package that we built, with their sizes in bytes."""
    return {path.name: path.stat().st_size for path in folder.glob("*.so")}


def read_record(folder: Path) -> BuildRecord | None:
    """Return the record of a package; `None` if we did not build it."""
    try:
        found = json.loads((folder / RECORD).read_text("utf-8"))
        return BuildRecord(**{name: found[name] for name in BuildRecord.__annotations__})
    except (OSError, ValueError, TypeError, KeyError):
        return None


def _share(folder: Path) -> Path | None:
    """Return a package's folder of .idl and .msg files: `share/NAME` in a folder above."""
    found = (above / "share" / folder.name for above in folder.parents)
    return next((path for path in found if (path / "package.xml").is_file()), None)


@dataclass(frozen=True)
class Dependency:
    """A package that is already built or installed, with its folders."""

    name: str
    share: Path  # of .idl, .msg and .json files
    include: Path
    libraries: Path
    record: BuildRecord | None  # `None` if we did not build it

    def messages(self) -> list[str]:
        return sorted(path.stem for path in (self.share / "msg").glob("*.idl"))

    def uses(self) -> set[str]:
        if self.record is not None:
            return set(self.record.uses)
        texts = (path.read_text("utf-8") for path in self.share.glob("*/*.idl"))
        return {name for text in texts for name in _INCLUDE.findall(text)} - {self.name}


def find(name: str, target: Path) -> Dependency | None:
    """Return the package that Python would import; packages built into `target` come first."""
    for entry in (target, *map(Path, sys.path)):
        folder = entry / name
        record, share = read_record(folder), _share(folder)
        if record is not None and share is not None:
            return Dependency(name, share, folder / "include", folder, record)
        if (folder / "__init__.py").is_file():
            break  # installed by a wheel of ROS
    prefix, share = Path(sys.prefix), Path(sys.prefix, "share", name)
    if not (share / "package.xml").is_file():
        return None
    return Dependency(name, share, prefix / "include" / name, prefix / "lib", None)


def with_all_they_use(names: Iterable[str], target: Path) -> tuple[dict[str, Dependency], set[str]]:
    """Return the packages with all that they use, and the names of packages that are missing."""
    found: dict[str, Dependency] = {}
    left, missing = set(names), set[str]()
    while left:
        name = left.pop()
        if (dependency := find(name, target)) is None:
            missing.add(name)
        else:
            found[name] = dependency
            left |= dependency.uses() - set(found) - missing
    return dict(sorted(found.items())), missing

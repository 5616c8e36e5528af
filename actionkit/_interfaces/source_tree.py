"""Finds the interface packages in a folder and reads their package.xml."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from dataclasses import dataclass
from keyword import iskeyword
from pathlib import Path
from xml.etree import ElementTree

from actionkit._interfaces import interface_file
from actionkit._interfaces.errors import BadSourceError
from actionkit._interfaces.interface_file import PARTS, InterfaceFile

OWN = Path(__file__).parent / "actionkit_interfaces"
"""The sources of the interface package that comes with ActionKit; `colcon build` works, too."""
_NAME = re.compile(r"(?!.*__)(?!.*_$)[a-z][a-z0-9_]*")
_VERSION = re.compile(r"\d+\.\d+\.\d+")
_IGNORE = ("COLCON_IGNORE", "AMENT_IGNORE", "pyvenv.cfg")
"""Files that mean: there are no packages in this folder."""
_SKIPPED = {"build", "install", "log", "node_modules", "__pycache__"}
GROUP = "rosidl_interface_packages"
"""The group that a package.xml has to name, for colcon."""
_MINIMAL = """<package format="3">
  <name>{name}</name>
  <version>0.1.0</version>
  <description>The interfaces of my robot.</description>
  <maintainer email="me@example.com">Me</maintainer><license>Apache-2.0</license>
  <member_of_group>rosidl_interface_packages</member_of_group>
</package>"""


@dataclass(frozen=True)
class Package:
    """The sources of an interface package."""

    name: str
    version: str
    summary: str
    declared: frozenset[str]  # the dependencies in its package.xml
    in_group: bool  # whether its package.xml says that it has interfaces
    folder: Path
    files: tuple[InterfaceFile, ...]

    def uses(self) -> set[str]:
        """Return the other packages with types that it uses."""
        return set[str]().union(*(file.packages() for file in self.files)) - {self.name}


def find_packages(folder: Path, skip: Path) -> dict[str, Package]:
    """Return the interface packages by name: the folder itself, or the packages below it."""
    if not folder.is_dir():
        raise BadSourceError(f"{folder}: there is no such folder")
    is_package = (folder / "package.xml").is_file()
    found: dict[str, Package] = {}
    for path in [folder] if is_package else _walk(folder, skip):
        package = _read(path)
        if package.files and found.setdefault(package.name, package) is not package:
            raise BadSourceError(
                f"{path}: the package {package.name!r} is in {found[package.name].folder} too."
                " Rename one in its package.xml, or put a file COLCON_IGNORE into its folder"
            )
    if not found:
        raise BadSourceError(f"{folder}: {_nothing_in(folder, is_package)}")
    return found


def _nothing_in(folder: Path, is_package: bool) -> str:
    if not is_package:
        name = re.sub(r"[^a-z0-9]+", "_", folder.resolve().name.lower()).strip("_")
        return (
            "there is no interface package here: neither a package.xml, nor folders that have one"
            f" and files in {', '.join(f'{kind}/' for kind in PARTS)}. A package.xml that will do:"
            f"\n\n{_MINIMAL.format(name=name if _NAME.fullmatch(name) else 'my_interfaces')}"
        )
    for kind in PARTS:
        for path in sorted(folder.rglob(f"*.{kind}")):
            lost = path.relative_to(folder)
            return f"nothing to build. Is it {lost}? That file belongs into the folder {kind}/."
    return "nothing to build. Put .msg files into msg/, .srv into srv/ and .action into action/."


def _walk(folder: Path, skip: Path) -> Iterator[Path]:
    for here, folders, files in os.walk(folder):
        if any(name in files for name in _IGNORE) or Path(here) == skip:
            folders.clear()
        elif "package.xml" in files:
            folders.clear()
            yield Path(here)
        folders[:] = sorted(n for n in folders if n not in _SKIPPED and not n.startswith("."))


def _read(folder: Path) -> Package:
    path = folder / "package.xml"
    try:
        root = ElementTree.fromstring(path.read_bytes())
    except (OSError, ElementTree.ParseError) as error:
        raise BadSourceError(f"{path}: {error}") from None
    name, version, summary = (
        " ".join((root.findtext(tag) or "").split()) for tag in ("name", "version", "description")
    )
    if not _NAME.fullmatch(name) or iskeyword(name):
        raise BadSourceError(
            f"{path}: <name> is {name!r}, which ROS or Python cannot import: begin it with a small"
            " letter, and use small letters, digits and single underscores only, as pick_interfaces"
        )
    if not _VERSION.fullmatch(version):
        raise BadSourceError(f"{path}: <version> is {version!r}; it has to be as 0.1.0")
    declared = {(node.text or "").strip() for node in root if node.tag.endswith("depend")}
    in_group = any((node.text or "").strip() == GROUP for node in root.iter("member_of_group"))
    files = tuple(interface_file.read(name, folder, path) for path in _files(folder))
    return Package(name, version, summary, frozenset(declared), in_group, folder, files)


def _files(folder: Path) -> Iterator[Path]:
    """Yield the files of a package, relative to its folder."""
    for kind in PARTS:
        found = sorted((folder / kind).glob(f"*.{kind}"))
        yield from (path.relative_to(folder) for path in found)
        for idl in sorted((folder / kind).glob("*.idl")):
            if idl.with_suffix(f".{kind}") not in found:
                raise BadSourceError(
                    f"{idl}: .idl files are not built here: write it as .msg, .srv or .action"
                )

"""The interface packages in a folder, by their package.xml."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from keyword import iskeyword
from pathlib import Path
from xml.etree import ElementTree

from actionkit._interfaces.errors import BadSourceError

OWN = Path(__file__).parent / "actionkit_interfaces"
"""The interface package that comes with ActionKit, as sources, which `colcon build` takes too."""
KINDS = ("msg", "srv", "action")
"""The folders of a package, which are the endings of their files too."""
_NAME = re.compile(r"(?!.*__)(?!.*_$)[a-z][a-z0-9_]*")
_VERSION = re.compile(r"\d+\.\d+\.\d+")
_IGNORE = ("COLCON_IGNORE", "AMENT_IGNORE", "pyvenv.cfg")
"""Files that say: no packages below here."""
_SKIPPED = {"build", "install", "log", "node_modules", "__pycache__"}
_MINIMAL = """<package format="3">
  <name>{name}</name>
  <version>0.1.0</version>
  <description>The interfaces of my robot.</description>
  <maintainer email="me@example.com">Me</maintainer>
  <license>Apache-2.0</license>
  <member_of_group>rosidl_interface_packages</member_of_group>
</package>"""


@dataclass(frozen=True)
class Package:
    """An interface package as its author wrote it.

    Attributes:
        name: From package.xml.
        version: From there too.
        summary: And its description.
        declared: The packages that it names as dependencies.
        folder: Where it is.
        files: Its .msg, .srv and .action files, relative to `folder`, sorted.
    """

    name: str
    version: str
    summary: str
    declared: frozenset[str]
    folder: Path
    files: tuple[Path, ...]


def find_packages(folder: Path, skip: Path | None = None) -> list[Package]:
    """Return the interface packages of a folder: the folder itself, or those below it.

    Raises:
        BadSourceError: There is none, two have one name, or a package.xml is wrong.
    """
    if not folder.is_dir():
        raise BadSourceError(f"{folder}: there is no such folder")
    if (folder / "package.xml").is_file():
        found = [_read(folder)]
        if not found[0].files:
            raise BadSourceError(f"{folder}: nothing to build. {_where_files_belong(folder)}")
        return found
    found = [package for path in _walk(folder, skip) if (package := _read(path)).files]
    if not found:
        raise BadSourceError(
            f"{folder}: there is no interface package here: neither a package.xml, nor folders that"
            f" have one and files in {', '.join(f'{kind}/' for kind in KINDS)}. A package.xml that"
            f" will do:\n\n{_MINIMAL.format(name=_proposed_name(folder))}"
        )
    by_name: dict[str, Package] = {}
    for package in found:
        other = by_name.setdefault(package.name, package)
        if other is not package:
            raise BadSourceError(
                f"{package.folder}: the package {package.name!r} is in {other.folder} too. Rename"
                " one in its package.xml, or put a file COLCON_IGNORE into its folder"
            )
    return found


def _walk(folder: Path, skip: Path | None) -> list[Path]:
    found = []
    for here, folders, files in os.walk(folder):
        if any(name in files for name in _IGNORE) or Path(here) == skip:
            folders.clear()
        elif "package.xml" in files:
            found.append(Path(here))
            folders.clear()
        folders[:] = sorted(n for n in folders if n not in _SKIPPED and not n.startswith("."))
    return found


def _read(folder: Path) -> Package:
    path = folder / "package.xml"
    try:
        root = ElementTree.fromstring(path.read_bytes())
    except (OSError, ElementTree.ParseError) as error:
        raise BadSourceError(f"{path}: {error}") from None
    name, version = (_text(root, tag) for tag in ("name", "version"))
    if not _NAME.fullmatch(name):
        raise BadSourceError(
            f"{path}: <name> is {name!r}; it has to begin with a small letter and to have small"
            " letters, digits and single underscores only, as pick_interfaces"
        )
    if iskeyword(name):
        raise BadSourceError(f"{path}: <name> is {name!r}, which Python cannot import: rename it")
    if not _VERSION.fullmatch(version):
        raise BadSourceError(f"{path}: <version> is {version!r}; it has to be as 0.1.0")
    declared = {
        (node.text or "").strip() for node in root if node.tag.endswith(("depend", "depends"))
    }
    summary = " ".join(_text(root, "description").split())
    files = _files(folder) if name else ()
    return Package(name, version, summary, frozenset(declared), folder, files)


def _text(root: ElementTree.Element, tag: str) -> str:
    return (root.findtext(tag) or "").strip()


def _files(folder: Path) -> tuple[Path, ...]:
    found = [path for kind in KINDS for path in sorted((folder / kind).glob(f"*.{kind}"))]
    named = {path.with_suffix("") for path in found}
    for idl in (path for kind in KINDS for path in sorted((folder / kind).glob("*.idl"))):
        if idl.with_suffix("") not in named:
            raise BadSourceError(
                f"{idl}: .idl files are not built here: write it as .msg, .srv or .action"
            )
    return tuple(path.relative_to(folder) for path in found)


def _where_files_belong(folder: Path) -> str:
    for kind in KINDS:
        for path in sorted(folder.rglob(f"*.{kind}")):
            return f"Is it {path.relative_to(folder)}? That file belongs into the folder {kind}/."
    return "Put .msg files into msg/, .srv files into srv/ and .action files into action/."


def _proposed_name(folder: Path) -> str:
    name = re.sub(r"[^a-z0-9]+", "_", folder.resolve().name.lower()).strip("_")
    return name if _NAME.fullmatch(name) else "my_interfaces"

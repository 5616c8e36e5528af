"""What pip knows of an installed package: it lists it, and takes it away again."""

from __future__ import annotations

import base64
import csv
import hashlib
import os
import sys
import sysconfig
from collections.abc import Iterable
from importlib.metadata import PackagePath, distributions
from pathlib import Path

from actionkit._interfaces.source_tree import Package


def site_packages() -> Path:
    """Return where packages of this Python environment are installed."""
    return Path(sysconfig.get_paths()["platlib"])


def prefix() -> Path:
    """Return where the folders `share` of this Python environment is."""
    return Path(sys.prefix)


def metadata_folder(package: Package) -> str:
    return f"{package.name}-{package.version}.dist-info"


def older_metadata(package: Package) -> list[Path]:
    """Return the metadata of other versions of it, written by us."""
    found = site_packages().glob(f"{package.name}-*.dist-info")
    return [
        path
        for path in found
        if path.name != metadata_folder(package)
        and (path / "INSTALLER").is_file()
        and (path / "INSTALLER").read_text("utf-8").strip() == "actionkit"
    ]


def owner_of(name: str) -> str | None:
    """Return the distribution that installed the importable package of that name, if one did."""
    for one in distributions():
        files: Iterable[PackagePath] = one.files or ()
        if any(file.parts[:1] == (name,) for file in files):
            return str(one.metadata["Name"])
    return None


def write_metadata(package: Package, folder: Path, installed: Iterable[Path]) -> None:
    """Write the metadata of a package.

    Args:
        package: The package.
        folder: Where to write; it will be `metadata_folder(package)` in `site_packages()`.
        installed: All files of the package, in place.
    """
    folder.mkdir()
    summary = package.summary or f"ROS 2 interfaces {package.name}"
    (folder / "METADATA").write_text(
        f"Metadata-Version: 2.1\nName: {package.name}\nVersion: {package.version}\n"
        f"Summary: {summary}\n",
        "utf-8",
    )
    (folder / "INSTALLER").write_text("actionkit\n", "utf-8")
    (folder / "top_level.txt").write_text(f"{package.name}\n", "utf-8")
    site = site_packages()
    rows = [(os.path.relpath(path, site), *_hash(path)) for path in installed]
    place = metadata_folder(package)
    rows += [(f"{place}/{path.name}", *_hash(path)) for path in sorted(folder.iterdir())]
    rows.append((f"{place}/RECORD", "", ""))
    with (folder / "RECORD").open("w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows(rows)


def _hash(path: Path) -> tuple[str, str]:
    data = path.read_bytes()
    word = base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()
    return f"sha256={word}", str(len(data))

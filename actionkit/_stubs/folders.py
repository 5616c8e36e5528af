"""Puts stub files into folders where type checkers look, and removes them again.

A folder is replaced as a whole, so no file of a removed type stays. Foreign files are not touched.
"""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path

MARK = "# Made by `actionkit stubs`, which overwrites it."
"""The first line of each file; files without it are not ours."""
_PARTIAL = "py.typed"
"""In stubs beside installed packages, its text `partial` tells checkers to read from the package
itself what the stubs do not have (PEP 561)."""


class ForeignFilesError(Exception):
    """A folder has files that `actionkit stubs` has not made."""


def replace(folder: Path, files: dict[str, str], *, partial: bool) -> bool:
    """Make a folder have these files and no others; return whether anything changed."""
    wanted = {**files, _PARTIAL: "partial\n"} if partial else files
    if _ours(folder) == wanted:
        return False
    folder.parent.mkdir(parents=True, exist_ok=True)
    # Moved there when it is complete: a file cut short by a kill would look like somebody else's.
    with tempfile.TemporaryDirectory(prefix=".actionkit-stubs-", dir=folder.parent) as scratch:
        new = Path(scratch, folder.name)
        for name, text in wanted.items():
            path = new / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, "utf-8")
        remove(folder)
        new.rename(folder)
    return True


def remove(folder: Path) -> bool:
    """Remove a folder that `replace` has made; return whether there was one."""
    if _ours(folder) is None:
        return False
    shutil.rmtree(folder)
    return True


def _ours(folder: Path) -> dict[str, str] | None:
    """Return the files of a folder that we have made; `None` if there is no folder."""
    if folder.is_symlink() or folder.is_file():
        raise ForeignFilesError(f"{folder} is not a folder that `actionkit stubs` has made.")
    if not folder.exists():
        return None
    found: dict[str, str] = {}
    for path in sorted(folder.rglob("*")):
        if path.is_dir() or "__pycache__" in path.parts:
            continue
        name = path.relative_to(folder).as_posix()
        # Our files have our first line.
        text = path.read_bytes().decode("utf-8", "replace")
        if name != _PARTIAL and text.partition("\n")[0] != MARK:
            told = f"{path} is not made by `actionkit stubs`, so {folder} stays as it is."
            raise ForeignFilesError(told)
        found[name] = text
    return found

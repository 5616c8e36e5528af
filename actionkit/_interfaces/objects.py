"""Compiling, each text once: what was compiled before is taken from the user's cache."""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import tempfile
import time
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from actionkit._interfaces import compiler as compilers
from actionkit._interfaces.compiler import Compiler
from actionkit._interfaces.fingerprint import digest

_TYPES_IN_A_UNIT = 8
"""Files that are compiled as one. The headers cost more than the types: all files of a package at
once take a fifth of the time that each alone takes; but two processors should both have work."""
_KEPT = 30 * 24 * 3600.0
"""Seconds for which a compiled file is kept that nobody has used."""
_INCLUDE = re.compile(r'^#include "([^"]+)"', re.M)
_INCLUDES = re.compile(r'(?:^#include "[^"]+"[^\n]*\n)+', re.M)


@dataclass(frozen=True)
class Unit:
    """Generated files that are compiled as one.

    Attributes:
        library: The folder of `generators.LIBRARIES` that they are in.
        files: Relative to the working folder.
    """

    library: str
    files: tuple[Path, ...]

    @property
    def is_cpp(self) -> bool:
        return self.files[0].suffix == ".cpp"

    def text(self) -> str:
        return "".join(f'#include "{file}"\n' for file in self.files)


def units(work: Path, libraries: Iterable[str]) -> list[Unit]:
    """Return what is to be compiled; those that take longest first."""
    found = []
    for library in libraries:
        groups: dict[tuple[str, ...], list[Path]] = {}
        for path in sorted((work / library).rglob("*.c*")):
            file = path.relative_to(work)
            # Within one kind and role no two files define one name; descriptions all do.
            alone = file.stem if file.stem.endswith("__description") or ".ep." in file.name else ""
            role = file.stem.rpartition("__")[2] if library == "c" else ""
            groups.setdefault((str(file.parent), role, alone), []).append(file)
        for group in groups.values():
            for start in range(0, len(group), _TYPES_IN_A_UNIT):
                found.append(Unit(library, tuple(group[start : start + _TYPES_IN_A_UNIT])))
    return sorted(found, key=lambda unit: (not unit.is_cpp, -len(unit.files)))


def compile_all(
    work: Path, found: Sequence[Unit], includes: Sequence[Path], compiler: Compiler, salt: str
) -> dict[Unit, Path]:
    """Compile, as many at a time as there are processors.

    Args:
        work: The working folder of the generators.
        found: What to compile.
        includes: Folders of headers. Those in `work` come first.
        compiler: What compiles.
        salt: A word for all headers outside of `work`.

    Returns:
        The compiled files.

    Raises:
        InterfacesError: The compiler fails.
    """
    own = [path for path in includes if path.is_relative_to(work)]
    # Not a way up from `work`: where a link is on it, that leads elsewhere.
    folders = [path.relative_to(work) if path in own else path for path in includes]
    flags = [flag for path in folders for flag in ("-I", str(path))]
    cache = _cache()
    output = work / "objects"
    output.mkdir()

    def compiled(unit: Unit) -> Path:
        command = compiler.cpp if unit.is_cpp else compiler.c
        key = digest(salt, *command, *_texts(work, unit, own))
        kept = cache / f"{key}.o" if cache is not None else output / f"{key}.o"
        with contextlib.suppress(OSError):
            os.utime(kept)
            # A copy: others may clear the cache meanwhile.
            return Path(shutil.copyfile(kept, output / f"{key}.o"))
        text = output / f"{key}{unit.files[0].suffix}"
        text.write_text(unit.text(), "utf-8")
        made = text.with_suffix(".o")
        words = [*command, "-I", ".", *flags, "-c", str(text), "-o", str(made)]
        compilers.run(words, work, f"compiling {unit.files[0].name}")
        if cache is not None:
            with contextlib.suppress(OSError):
                _keep(made, kept)
        return made

    with ThreadPoolExecutor(_processors()) as pool:
        try:
            return dict(zip(found, pool.map(compiled, found), strict=True))
        except BaseException:  # also Ctrl-C: no compiler is left at work
            pool.shutdown(wait=True, cancel_futures=True)
            raise


def clear_old() -> None:
    """Remove from the cache what nobody has used for a month."""
    cache = _cache()
    if cache is None:
        return
    for path in cache.iterdir():
        with contextlib.suppress(OSError):
            if path.stat().st_mtime < time.time() - _KEPT:
                path.unlink()


def _texts(work: Path, unit: Unit, includes: Sequence[Path]) -> list[str]:
    """Return the texts of the files and of all headers of the package that they include."""
    left = [work / file for file in unit.files]
    seen = set(left)
    texts = []
    while left:
        path = left.pop()
        text = path.read_text("utf-8")
        # The generators write some of them in an order that differs from run to run.
        texts.append(_INCLUDES.sub(lambda found: "".join(sorted(found[0].splitlines(True))), text))
        for name in _INCLUDE.findall(text):
            for folder in includes:
                if (header := folder / name).is_file() and header not in seen:
                    seen.add(header)
                    left.append(header)
    return [*map(str, unit.files), *sorted(texts)]


def _keep(made: Path, kept: Path) -> None:
    handle, name = tempfile.mkstemp(dir=kept.parent)
    os.close(handle)
    try:
        shutil.copyfile(made, name)
        os.replace(name, kept)
    except OSError:
        os.unlink(name)
        raise


def _cache() -> Path | None:
    try:
        root = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
        path = Path(root, "actionkit", "interfaces")
        path.mkdir(parents=True, exist_ok=True)
    except (OSError, RuntimeError):  # the latter where nobody has a home
        return None
    return path if os.access(path, os.W_OK) else None


def _processors() -> int:
    return len(os.sched_getaffinity(0))

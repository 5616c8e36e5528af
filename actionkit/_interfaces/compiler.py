"""The C and C++ compiler, and the headers of Python."""

from __future__ import annotations

import importlib.util
import os
import platform
import shlex
import shutil
import subprocess
import sys
import sysconfig
from dataclasses import dataclass
from pathlib import Path

from actionkit._interfaces.errors import InterfacesError, MissingToolError

_SHOWN = 12
"""Lines of a compiler's errors that are shown; the first one is the cause."""


@dataclass(frozen=True)
class Compiler:
    """The commands, and the flags of every compilation.

    Attributes:
        c: Words of the command that compiles C, with its flags.
        cpp: The same for C++.
        link: Words of the command that links.
        link_flags: More words for it, at the end.
    """

    c: tuple[str, ...]
    cpp: tuple[str, ...]
    link: tuple[str, ...]
    link_flags: tuple[str, ...]


def find_compiler() -> Compiler:
    """Return the compiler: by CC and CXX, or gcc, clang or the package ziglang, the first there is.

    Raises:
        MissingToolError: There is none, or Python.h is missing.
    """
    if not Path(python_headers(), "Python.h").is_file():
        version = f"{sys.version_info.major}.{sys.version_info.minor}"
        raise MissingToolError(
            f"Python.h is not in {python_headers()}: it is needed to compile."
            f" On Ubuntu: sudo apt install python{version}-dev"
        )
    cc, cxx = (_words(name) for name in ("CC", "CXX"))
    for c, cpp in ((["gcc"], ["g++"]), (["cc"], ["c++"]), (["clang"], ["clang++"]), _zig()):
        if (cc or _is_here(c)) and (cxx or _is_here(cpp)):
            cc, cxx = cc or c, cxx or cpp
            break
    if not cc or not cxx:
        raise MissingToolError(
            "a C++ compiler is needed to build interfaces, and none is on PATH. On Ubuntu:"
            " sudo apt install g++ (or, without root: pip install ziglang, which is slower)"
        )
    for name, words in (("CC", cc), ("CXX", cxx)):
        if not _is_here(words):
            raise MissingToolError(
                f"the variable {name} of the environment names {words[0]!r}, which is not here:"
                f" install it, or unset {name}"
            )
    common = ["-fPIC", "-w", *_words("CPPFLAGS")]
    c_flags = _words("CFLAGS") or ["-O2"]
    cpp_flags = _words("CXXFLAGS") or ["-O2"]
    return Compiler(
        (*cc, "-std=gnu11", "-Ulinux", "-Uunix", *common, *c_flags),
        (*cxx, "-std=gnu++17", "-Ulinux", "-Uunix", *common, *cpp_flags),
        tuple(cxx),
        tuple(_words("LDFLAGS")),
    )


def python_headers() -> str:
    """Return the folder that Python.h belongs into."""
    return sysconfig.get_paths()["include"]


def run(words: list[str], folder: Path, what: str) -> None:
    """Run a compiler.

    Raises:
        InterfacesError: It fails; the text has its first errors.
    """
    done = subprocess.run(
        words, cwd=folder, stdin=subprocess.DEVNULL, capture_output=True, check=False
    )
    if done.returncode:
        lines = done.stderr.decode(errors="replace").strip().splitlines()
        shown = "\n".join(lines[:_SHOWN])
        raise InterfacesError(f"{what}: {words[0]} failed (exit code {done.returncode}):\n{shown}")


def _words(variable: str) -> list[str]:
    return shlex.split(os.environ.get(variable, ""))


def _is_here(words: list[str]) -> bool:
    return shutil.which(words[0]) is not None


def _zig() -> tuple[list[str], list[str]]:
    if importlib.util.find_spec("ziglang") is None:
        return ["ziglang"], ["ziglang"]  # no such commands: there is no compiler
    # The C library that Python was linked with, not the newest that zig knows.
    target = ["-target", f"{platform.machine()}-linux-gnu"]
    zig = [sys.executable, "-m", "ziglang"]
    return [*zig, "cc", *target], [*zig, "c++", *target]

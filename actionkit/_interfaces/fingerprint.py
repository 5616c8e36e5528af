"""One word for all that a package is made from: the same word, the same libraries."""

from __future__ import annotations

import hashlib
import os
import sys
import sysconfig
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path

from actionkit._interfaces.dependencies import Dependency
from actionkit._interfaces.wheel import Target

_FORMAT = 3
"""To be raised when what is built changes though its sources do not."""
GENERATORS = (
    "rosidl_adapter",
    "rosidl_generator_c",
    "rosidl_generator_py",
    "rosidl_generator_type_description",
    "rosidl_typesupport_c",
    "rosidl_typesupport_fastrtps_c",
    "rosidl_typesupport_introspection_c",
)
VARIABLES = ("CC", "CXX", "CPPFLAGS", "CFLAGS", "CXXFLAGS", "LDFLAGS")
"""Variables of the environment that say how to compile."""


def digest(*parts: object) -> str:
    """Return a word that differs wherever one of the parts does."""
    sha = hashlib.sha256()
    for part in parts:
        data = part if isinstance(part, bytes) else str(part).encode("utf-8", "surrogateescape")
        sha.update(len(data).to_bytes(8, "little") + data)
    return sha.hexdigest()


@cache
def of_machine() -> str:
    """Return the word for this Python, its packages of ROS and the variables for compilers."""
    share = Path(sys.prefix, "share")
    versions = [_bytes(share / name / "package.xml") for name in GENERATORS]
    variables = [os.environ.get(name, "") for name in VARIABLES]
    return digest(_FORMAT, sysconfig.get_config_var("EXT_SUFFIX"), *versions, *variables)


def of_package(
    sources: Mapping[str, str],
    description: bytes,
    dependencies: Iterable[Dependency],
    target: Target,
) -> str:
    """Return the word for a package.

    Args:
        sources: The texts of its files by their paths.
        description: Its package.xml.
        dependencies: The packages that it uses, with those that these use.
        target: Where it goes.
    """
    parts: list[object] = [of_machine(), description]
    for path, text in sorted(sources.items()):
        parts += [path, text]
    for dependency in dependencies:
        # Where those of our own are is written into the libraries.
        away = dependency.libraries if target.is_away(dependency) else ""
        parts += [dependency.name, away, of_dependency(dependency)]
    return digest(*parts)


def of_dependency(dependency: Dependency) -> str:
    """Return the word for a package that is there already."""
    if dependency.record is not None:
        return dependency.record.key
    return _of_installed(dependency.share)


@cache
def _of_installed(share: Path) -> str:
    # The .json files hold the hashes of the types.
    paths = [share / "package.xml", *sorted(share.glob("*/*.json"))]
    return digest(*(_bytes(path) for path in paths))


def _bytes(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError:
        return b""

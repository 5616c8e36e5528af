"""One word for all that a package is made from: the same word, the same libraries."""

from __future__ import annotations

import hashlib
import os
import sys
import sysconfig
from collections.abc import Iterable
from pathlib import Path

from actionkit._interfaces.dependencies import Dependency
from actionkit._interfaces.interface_file import InterfaceFile
from actionkit._interfaces.source_tree import Package
from actionkit._interfaces.wheel import Target

_FORMAT = 3
"""To be raised when what is built changes though its sources do not."""
_GENERATORS = (
    "rosidl_adapter",
    "rosidl_generator_c",
    "rosidl_generator_py",
    "rosidl_generator_type_description",
    "rosidl_typesupport_c",
    "rosidl_typesupport_fastrtps_c",
    "rosidl_typesupport_introspection_c",
)
_VARIABLES = ("CC", "CXX", "CPPFLAGS", "CFLAGS", "CXXFLAGS", "LDFLAGS")
"""Variables of the environment that say how to compile."""


def of_package(
    package: Package, files: Iterable[InterfaceFile], used: Iterable[Dependency], target: Target
) -> str:
    """Return the word for a package and all packages that it uses, in turn too."""
    share = Path(sys.prefix, "share")
    parts: list[object] = [_FORMAT, sysconfig.get_config_var("EXT_SUFFIX")]
    parts += [os.environ.get(name, "") for name in _VARIABLES]
    parts += [_bytes(share / name / "package.xml") for name in _GENERATORS]
    parts.append(_bytes(package.folder / "package.xml"))
    for file in files:
        parts += [file.path, file.text]
    for one in used:
        # Where those of our own are is written into the libraries.
        parts += [one.name, one.libraries if target.is_away(one) else ""]
        if one.record is not None:
            parts.append(one.record.key)
        else:  # the .json files hold the hashes of the types
            paths = [one.share / "package.xml", *sorted(one.share.glob("*/*.json"))]
            parts += [_bytes(path) for path in paths]
    sha = hashlib.sha256()
    for part in parts:
        data = part if isinstance(part, bytes) else str(part).encode("utf-8", "surrogateescape")
        sha.update(len(data).to_bytes(8, "little") + data)
    return sha.hexdigest()


def _bytes(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError:
        return b""

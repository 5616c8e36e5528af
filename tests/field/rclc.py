"""Builds micro-ROS' client library together with a server in C."""

from __future__ import annotations

import subprocess
import sys
from functools import partial
from pathlib import Path

from tests.field.sources import FIELD, SERVERS, Missing, built, need, upstream

_LIBRARIES = (
    *("rcl", "rcl_action", "rcutils", "rmw", "rosidl_runtime_c", "rosidl_typesupport_c"),
    *("test_msgs__rosidl_typesupport_c", "test_msgs__rosidl_generator_c"),
    *("action_msgs__rosidl_typesupport_c", "action_msgs__rosidl_generator_c"),
)
_BACKPORT = "rcl_wait_set_is_valid_backport.c"
"""For versions of rcl before Foxy."""


def library(server: str) -> Path:
    """Return the library with this server, which has the function `srv_main`; build it if need be.

    Raises:
        Missing: It cannot be built here.
    """
    source = SERVERS / f"{server}.c"
    if not source.exists():
        raise Missing(f"there is no {source}")
    need("gcc")
    parts = FIELD / "upstream.tar.xz", source, Path(__file__)
    return built(server, partial(_build, source), *parts) / "library.so"


def _build(source: Path, folder: Path) -> None:
    rclc, wheels = upstream() / "rclc" / "rclc", Path(sys.prefix)
    sources = [path for path in (rclc / "src" / "rclc").glob("*.c") if path.name != _BACKPORT]
    compiler = ["gcc", "-O1", "-fPIC", "-pthread", "-w", '-DROS_PACKAGE_NAME="rclc"']
    compiler += [f"-I{rclc / 'include'}", f"-I{rclc / 'src' / 'rclc'}"]
    for headers in (wheels / "include").iterdir():
        if "python" not in headers.name:
            compiler += ["-isystem", str(headers)]
    # Of a goal that aborts at once, the server frees a pointer that it has never set.
    own = folder / "server.o"
    zeroed = ["-ftrivial-auto-var-init=zero", "-c", str(source), "-o", str(own)]
    linked = ["-shared", str(own), *map(str, sources), "-o", str(folder / "library.so")]
    linked += [f"-L{wheels / 'lib'}", *(f"-l{name}" for name in _LIBRARIES)]
    for rest in (zeroed, [*linked, "-Wl,--allow-shlib-undefined"]):
        subprocess.run([*compiler, *rest], check=True)

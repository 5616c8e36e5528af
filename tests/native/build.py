"""Finds rclcpp and CycloneDDS, or builds them, and compiles the server in C++."""

from __future__ import annotations

import fcntl
import hashlib
import os
import subprocess
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path

TOP = Path(__file__).parents[2]
_SOURCE = Path(__file__).with_name("server.cpp")
SOURCES = Path(os.environ.get("ACTIONKIT_NATIVE_SOURCES") or TOP.parent / "shared" / "native")
"""Where the project keeps the sources of what no package index has."""
_BUILT = Path(os.environ.get("ACTIONKIT_NATIVE") or Path.home() / ".cache" / "actionkit-native")
"""Where they are built. It is outside of the checkout, and kept: building takes three minutes."""
_LIBRARIES = (
    *("rclcpp_action", "rclcpp", "rcl_action", "rcl", "rcutils", "rcpputils", "tracetools"),
    *("test_msgs__rosidl_typesupport_cpp", "action_msgs__rosidl_typesupport_cpp"),
)


def prefix() -> Path:
    """Return the folder whose `lib` and `include` have rclcpp: a ROS 2 that is sourced, or ours."""
    sourced = map(Path, filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(":")))
    return next((path for path in sourced if (path / "include/rclcpp_action").exists()), _BUILT)


def library() -> Path:
    """Return where the compiled server is; another one for each version of the source."""
    version = hashlib.sha256(_SOURCE.read_bytes()).hexdigest()[:12]
    return _BUILT / f"libreference_server-{version}.so"


def build() -> None:
    """Build what is missing.

    Raises:
        RuntimeError: It cannot be built here.
    """
    _BUILT.mkdir(parents=True, exist_ok=True)
    with open(_BUILT / "lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # one process builds, the others wait
        if prefix() == _BUILT and not (_BUILT / "ready").exists():
            if not (SOURCES / "build").exists():
                raise RuntimeError(f"there is no rclcpp in {_BUILT}; CONTRIBUTING.md tells more")
            subprocess.run([SOURCES / "build", sys.prefix, _BUILT], check=True)
        if not library().exists():
            compile_cpp([_SOURCE], library())


def environment() -> dict[str, str]:
    """Return the variables of a process that uses CycloneDDS."""
    chosen = {"RMW_IMPLEMENTATION": "rmw_cyclonedds_cpp"}
    if prefix() != _BUILT:
        return chosen
    wheels = Path(sys.prefix)
    folders = [wheels / "lib", _BUILT / "lib", *wheels.glob("lib/python3*/site-packages/*.libs")]
    return chosen | {
        # The wheels' librcl is linked with Fast DDS, so the first variable alone changes nothing.
        "LD_PRELOAD": str(_BUILT / "lib" / "librmw_cyclonedds_cpp.so"),
        "LD_LIBRARY_PATH": ":".join(map(str, folders)),
    }


def compile_cpp(sources: Sequence[Path], output: Path, includes: Iterable[Path] = ()) -> None:
    """Compile a library that uses rclcpp; a process that looks at it meanwhile sees none."""
    wheels = Path(sys.prefix)
    headers = [*(wheels / "include").glob("*"), *(prefix() / "include").glob("*"), *includes]
    unfinished = output.with_suffix(".unfinished")
    command = ["g++", "-std=c++17", "-O1", "-fPIC", "-shared", "-Wall", *map(str, sources)]
    command += ["-o", str(unfinished), f"-I{prefix() / 'include'}"]
    for folder in headers:
        if "python" not in folder.name:
            command += ["-isystem", str(folder)]
    command += [f"-L{prefix() / 'lib'}", f"-L{wheels / 'lib'}"]
    command += [f"-l{name}" for name in _LIBRARIES]
    subprocess.run([*command, "-Wl,--allow-shlib-undefined"], check=True)
    unfinished.rename(output)

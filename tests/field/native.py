"""Compiles and starts the field's servers in C++."""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import threading
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import tests.native.build
from tests.field.kind import Server
from tests.field.sources import FIELD, SERVERS, TOP, Missing, built, need, upstream
from tests.native.build import build, compile_cpp, prefix

_SOURCES = (SERVERS / "srv.cpp", Path(__file__).with_name("node_thread.cpp"))
_HEADERS = ("nav2/nav2_util/include", "rt/realtime_tools/include")
_LAUNCHER = f"""
import sys
sys.path.insert(0, {str(TOP)!r})
from tests.field.native import main
main()
"""
_DEBUG = 10  # RCUTILS_LOG_SEVERITY_DEBUG


def program(kind: str) -> Sequence[str]:
    """Return what Python runs to serve one of the kinds in `srv.cpp`.

    Raises:
        Missing: There is no compiler here, or no rclcpp.
    """
    return "-c", _LAUNCHER, str(_library()), kind


def obey(server: Server, command: str) -> None:
    """Tell a server something, and wait until it has done so."""
    before = sum(f"SRV command {command}" in line for line in server.lines)
    for _ in range(2):  # it says so before it does so, one after the other
        server.tell(command)
    server.wait_for_text(f"SRV command {command}", before + 2)


@cache
def _library() -> Path:
    headers = [upstream() / folder for folder in _HEADERS]

    def make(folder: Path) -> None:
        compile_cpp(_SOURCES, folder / "libservers.so", headers)

    return built("cpp", make, *_SOURCES, *rclcpp()) / "libservers.so"


@cache
def rclcpp() -> Sequence[Path]:
    """Build rclcpp where it is missing; return files that change if it changes, or how it is used.

    Raises:
        Missing: It cannot be built here.
    """
    need("g++", "cmake", "make")
    try:
        build()
    except RuntimeError as error:
        raise Missing(str(error)) from error
    library = prefix() / "lib" / "librclcpp_action.so"
    return library, Path(tests.native.build.__file__), FIELD / "upstream.tar.xz"


def main() -> None:
    """Serve until SIGINT, SIGTERM, or the end of standard input; its lines are commands."""
    library, kind = sys.argv[1:3]
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM})
    # To standard error, as the servers' own lines, for the order of both.
    os.environ["RCUTILS_LOGGING_USE_STDOUT"] = "0"
    import rclpy  # noqa: F401  its libraries are those that rclcpp needs

    for file in ("librclcpp.so", "librclcpp_action.so"):
        ctypes.CDLL(str(prefix() / "lib" / file), ctypes.RTLD_GLOBAL)
    native = ctypes.CDLL(library)
    # Before there are threads that log: rcutils has no lock for this.
    native.rcutils_logging_initialize()
    native.rcutils_logging_set_logger_level(f"cpp_{kind[:3]}".encode(), _DEBUG)
    native.go(kind.encode(), 0)
    threading.Thread(target=_obey, args=(native,), daemon=True).start()
    signal.sigwait({signal.SIGINT, signal.SIGTERM})
    native.stop()
    os._exit(0)


def _obey(native: ctypes.CDLL) -> None:
    for line in sys.stdin:
        native.command(line.strip().encode())
    os.kill(os.getpid(), signal.SIGTERM)

"""The checks of `actionkit doctor` on Python and rclpy, without importing rclpy."""

from __future__ import annotations

import contextlib
import importlib.metadata
import os
import re
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

from actionkit._model.missing import ON_LINUX, RCLPY, WITH_ROS
from actionkit.cli.doctor._findings import Finding, note, ok, problem

_INSTALL = (
    f"{WITH_ROS}. Elsewhere: pip install {RCLPY}." if sys.platform == "linux" else f"{ON_LINUX}."
)
_PATIENCE = 30.0
"""Seconds to import rclpy; normally one, but many more from a slow disk."""
_TESTED = ((3, 10), (3, 13))
"""The oldest and the newest version of Python that ActionKit is tested with."""
_MADE_WITHIN = 2.0
"""Seconds; it takes microseconds."""
_UNFINISHED = (b"", bytes(4), (1).to_bytes(4, sys.byteorder))
"""The first bytes of a port's file until it can be used: it has no size; no content; some content.
It begins with a word of boost's `managed_open_or_create_impl`. Measured: with any other word there,
no process waits for it (Fast DDS 2.14)."""
_PREFIX = "/opt/ros/"


def machine(environment: Mapping[str, str] = os.environ) -> Iterator[Finding]:
    """Yield findings about Python and rclpy."""
    yield _python()
    yield ok(
        "actionkit",
        f"{_metadata('actionkit') or 'of unknown version'}, {Path(__file__).parents[1]}",
    )
    places = rclpy_places()
    if not places:
        yield problem("rclpy", "not found by this Python.", _INSTALL)
        yield from _other_python(environment)
        return
    if failure := _import_failure():
        yield _broken(places[0], failure, environment)
        return
    yield ok("rclpy", f"{rclpy_version(places[0])}, {places[0]} ({origin(places[0])})")
    if len(places) > 1:
        yield note(
            "rclpy",
            f"there is another one at {', '.join(map(str, places[1:]))}, which is not used.",
            "Two of them mix up their libraries: use either the ROS installation, without"
            " the extra ros, or a virtual environment in a shell where no setup file was sourced.",
        )
    distro = environment.get("ROS_DISTRO", "")
    if distro not in ("", "jazzy"):
        yield note(
            "ROS_DISTRO",
            f"is {distro!r}; ActionKit is tested with jazzy.",
            "Source the setup file of ROS 2 Jazzy, or expect differences.",
        )


def shared_memory(
    folder: Path = Path("/dev/shm"), let_pass: Callable[[float], object] = time.sleep
) -> Iterator[Finding]:
    """Yield a finding for each port of Fast DDS that stops every process here that opens it.

    A process that is killed while it makes the file of a port leaves it unfinished, and every other
    process that opens the file waits for that one without end. A process that lives finishes it at
    once, so an unfinished file is looked at twice. Its age is not asked: the clock may be wrong.
    """
    if unfinished := _unfinished(folder):
        let_pass(_MADE_WITHIN)
    for path in sorted(unfinished & _unfinished(folder)):
        yield problem(
            "shared memory",
            f"{path} is unfinished: a process was killed while it made this file. ROS programs that"
            " open it hang when they make a node, and use a whole core.",
            f"End the programs that hang, with kill -9; then: rm {path}",
        )


def _unfinished(folder: Path) -> set[Path]:
    """Return the files of ports that were not finished, if this process may write to them."""
    found = set()
    for path in folder.glob("fastrtps_port*"):
        if not path.name.removeprefix("fastrtps_port").isdigit():
            continue  # a lock file, always empty
        # Opened as Fast DDS does it: if that fails, Fast DDS goes on without the port.
        with contextlib.suppress(OSError), path.open("r+b") as file:
            if file.read(4) in _UNFINISHED:
                found.add(path)
    return found


def rclpy_places() -> list[Path]:
    """Return each directory named rclpy on Python's path, in its order."""
    found = []
    for entry in sys.path:
        place = Path(entry or ".") / "rclpy"
        if (place / "__init__.py").is_file() and place.resolve() not in found:
            found.append(place.resolve())
    # None in sys.modules switches a module off.
    return [] if "rclpy" in sys.modules and sys.modules["rclpy"] is None else found


def origin(place: Path) -> str:
    """Return in a few words where an rclpy comes from."""
    if str(place).startswith(_PREFIX):
        return f"the ROS installation {_PREFIX}{place.parts[3]}"
    if _version_at(place, "ros-jazzy-rclpy"):
        return "wheels from a package index"
    return "a workspace or another installation"


def _python() -> Finding:
    text = f"{sys.version.split()[0]}, {sys.executable}"
    first, last = (".".join(map(str, version)) for version in _TESTED)
    if _TESTED[0] <= sys.version_info[:2] <= _TESTED[1]:
        return ok("python", text)
    return note(
        "python",
        f"{text}: ActionKit is tested with {first} to {last}.",
        "ROS 2 Jazzy comes with Python 3.12: use that one where something does not work.",
    )


def _other_python(environment: Mapping[str, str]) -> Iterator[Finding]:
    """Yield findings about rclpy packages for another Python."""
    here = f"python{sys.version_info[0]}.{sys.version_info[1]}"
    prefixes = environment.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
    prefixes += [str(path) for path in sorted(Path(_PREFIX).glob("*"))]
    for prefix in dict.fromkeys(filter(None, prefixes)):
        for place in sorted(Path(prefix).glob("lib/python3*/site-packages/rclpy")):
            python = place.parts[-3]
            if python == here:
                text = f"there is one at {place}, which is not on Python's path."
                yield problem("rclpy", text, f"source {prefix}/setup.bash")
            else:
                text = f"there is one at {place}, for {python}; this is {here}."
                yield problem("rclpy", text, f"Install and run ActionKit with {python}.")


def _import_failure() -> str:
    """Return why rclpy cannot be imported, or `""`.

    This runs in another process: with a wrong RMW_IMPLEMENTATION, rcl ends its process.
    """
    # Also what every node needs: that loads the middleware, rclpy itself does not.
    code = "import rclpy.node, action_msgs.srv"
    try:
        run = subprocess.run(
            [sys.executable, "-c", code],
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=_PATIENCE,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return f"it took more than {_PATIENCE:g} s"
    if run.returncode == 0:
        return ""
    last = run.stderr.strip().splitlines()[-1:] or [""]
    return last[0] or f"the process ended with {run.returncode}"


def _broken(place: Path, error: str, environment: Mapping[str, str]) -> Finding:
    text = f"found at {place}, but it cannot be imported: {error}"
    rmw = environment.get("RMW_IMPLEMENTATION", "")
    remedy = _INSTALL
    if "rmw" in error.lower() and rmw:
        remedy = (
            f"RMW_IMPLEMENTATION={rmw} names a middleware that is not installed: unset it, or"
            f" install it (apt install ros-jazzy-{rmw.replace('_', '-')})."
        )
    elif "rmw" in error.lower():
        remedy = (
            f"No middleware is installed: pip install {RCLPY} (the extra"
            " matters), or apt install ros-jazzy-rmw-fastrtps-cpp."
        )
    elif "_BOOTSTRAP" in "".join(environment) and ".so" in error:
        remedy = (
            "This process was started by one of another virtual environment, whose library path"
            " it inherited: unset LD_LIBRARY_PATH and _ROS_WHEELS_BOOTSTRAP_COMPLETE."
        )
    return problem("rclpy", text, remedy)


def rclpy_version(place: Path) -> str:
    """Return the version of the rclpy there."""
    for name in ("ros-jazzy-rclpy", "rclpy"):
        if version := _version_at(place, name):
            return version
    package = place.parents[3] / "share" / "rclpy" / "package.xml"
    if package.is_file() and (found := re.search(r"<version>(.*?)<", package.read_text("utf-8"))):
        return found[1]
    return "of unknown version"


def _version_at(place: Path, name: str) -> str:
    """Return the version of the package `name` that was installed to the folder of `place`."""
    found = importlib.metadata.distributions(name=name, path=[str(place.parent)])
    return next((each.version for each in found), "")


def _metadata(name: str) -> str:
    """Return the version of an installed package, or `""`."""
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return ""

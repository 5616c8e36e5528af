"""Interface packages that the tests share: the first test process that needs one builds it."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests import forked
from tests.conftest import without_noise

PACKAGE = """<package format="3">
  <name>{name}</name>
  <version>{version}</version>
  <description>For tests.</description>
  <maintainer email="me@example.com">Me</maintainer>
  <license>Apache-2.0</license>
  {depends}
  <member_of_group>rosidl_interface_packages</member_of_group>
</package>
"""
SHIPPED = Path(sys.prefix, "share", "test_msgs")
"""The sources of test_msgs, which its wheel has."""


def write_package(
    folder: Path, files: dict[str, str | bytes], *, depends: str = "", version: str = "0.1.0"
) -> Path:
    """Write a package called as its folder."""
    tags = "".join(f"<depend>{name}</depend>" for name in depends.split())
    text = PACKAGE.format(name=folder.name, version=version, depends=tags)
    for name, content in {"package.xml": text, **files}.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return folder


def environment(*on_path: Path, **variables: str) -> dict[str, str]:
    """Return the environment for a process that imports packages from folders.

    The compiler optimizes nothing: that takes half of the time.
    """
    path = os.pathsep.join(map(str, on_path))
    return {**os.environ, "CFLAGS": "-O0", "CXXFLAGS": "-O0", "PYTHONPATH": path, **variables}


def actionkit(
    *words: object, env: dict[str, str] | None = None, python: str = sys.executable
) -> subprocess.CompletedProcess[str]:
    """Run the command line in a process of its own."""
    return forked.run(
        [python, "-m", "actionkit", *map(str, words)],
        env=env or environment(),
        cwd="/",
        capture_output=True,
        text=True,
        timeout=200,
        check=False,
    )


def run_python(code: str, *words: object, env: dict[str, str]) -> str:
    """Run a program and return what it prints."""
    done = forked.run(
        [sys.executable, "-c", code, *map(str, words)],
        env=env,
        cwd="/",
        capture_output=True,
        text=True,
        timeout=100,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return without_noise(done.stdout)


@pytest.fixture(scope="session")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder for all test processes of this run; commands lock what they build in it."""
    base = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        base = base.parent
    path = base / "interfaces"
    path.mkdir(exist_ok=True)
    return path


SHADOWING = """
import sys
from actionkit._interfaces import checks
from actionkit.cli import main
checks.name = lambda package, folder: None
main(["interfaces", "build", *sys.argv[1:]])
"""
"""`actionkit interfaces build`, which refuses to build a package that is installed already."""


def build_shadowing(source: Path, target: Path) -> None:
    """Build a package that has the name of an installed one."""
    done = forked.run(
        [sys.executable, "-c", SHADOWING, source, "-o", target],
        env=environment(),
        cwd="/",
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr


def built_once(shared: Path, name: str, *words: object) -> Path:
    """Build into a folder of that name, which is quick when another process has done it."""
    target = shared / name
    done = actionkit("interfaces", "build", *words, "-o", target)
    assert done.returncode == 0, done.stdout + done.stderr
    return target


@pytest.fixture(scope="session")
def own(shared: Path) -> Path:
    """A folder with actionkit_interfaces."""
    return built_once(shared, "own", "--own")


@pytest.fixture(scope="session")
def shadowing(shared: Path) -> Path:
    """A folder with test_msgs, built again from its sources."""
    build_shadowing(SHIPPED, shared / "shadowing")
    return shared / "shadowing"


ODD = """\ufeff# A file as editors and people leave it.\r
int32 array  # behind a field\r
  # belongs to the line above\r
string str\r
\tint64[] self\r
    # ends with --- and\r
string<=20 order 'a "quoted" one'\r
float64[3] data # --- [m]\r
# 物体 — über µ "quotes" \\ back\x0bslash\x85 \u2028 and more\r
odd_parts/Part part\r
odd_parts/Part[<=2] parts\r
bool property\r
string type\r
string[] sequence\r
---   # the result\r
#---\r
string msg\r
int32 class_name\r
string[] sequence\r
  ---\r
uint8 A_CONSTANT = 7\r
float32 percent\r
string[] sequence\r
string order\r
""".encode()
ODD_PARTS = {
    "msg/Part.msg": "string name\nHolder holder\n",
    "msg/Holder.msg": "geometry_msgs/Point at\n",
    "srv/Find.srv": "string name\n---\nPart part\n",
}
WIDE = "\n".join(f"int32 field_{n}" for n in range(200)) + "\n---\nint32 sum\n---\n"


@pytest.fixture(scope="session")
def odd(shared: Path) -> Path:
    """A folder with two packages, of which the first in the alphabet uses the second."""
    sources = shared / f"odd_sources_{os.getpid()}"
    write_package(
        sources / "below" / "odd_actions",
        {"action/Odd.action": ODD, "action/Wide.action": WIDE},
        depends="odd_parts",
    )
    write_package(sources / "odd_parts", ODD_PARTS, depends="geometry_msgs")
    return built_once(shared, "odd", sources)


@pytest.fixture
def python(tmp_path: Path) -> str:
    """The Python of a virtual environment in which ROS is, as it is in ours."""
    root, ours = tmp_path / "venv", Path(sys.prefix)
    forked.run([sys.executable, "-m", "venv", "--without-pip", root], check=True)
    version = f"python{sys.version_info.major}.{sys.version_info.minor}"
    site = Path("lib", version, "site-packages")
    (root / site / "ours.pth").write_text(f"{ours / site}\n{Path(__file__).parents[2]}\n")
    for folder in ("lib", "include", "share"):
        (root / folder).mkdir(exist_ok=True)
        for path in (ours / folder).iterdir():
            if path.name not in (version, "ament_index"):
                (root / folder / path.name).symlink_to(path)
    return str(root / "bin" / "python")

"""colcon builds ActionKit as a ROS package (C9.3).

Where no colcon is found these tests are skipped: `.ci/run` installs one from PyPI in an environment
of its own and names it in ACTIONKIT_COLCON.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import sysconfig
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from tests.packaging.release import NOT_COPIED

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
COLCON = os.environ.get("ACTIONKIT_COLCON") or shutil.which("colcon")

KEYS = {
    "click": "python3-click",
    "rich": "python3-rich",
    "typing-extensions": "python3-typing-extensions",
    "pyyaml": "python3-yaml",
}
"""Name on PyPI -> the name that rosdep knows."""
UNKNOWN = "tenacity"
"""rosdep has no name for it; the README tells how to get it."""


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """A copy of the checkout, which builds may write to."""
    copy = tmp_path / "src" / "actionkit"
    shutil.copytree(ROOT, copy, ignore=NOT_COPIED)
    return copy


# --- one source --------------------------------------------------------------------------------


def test_package_xml_says_what_pyproject_says() -> None:
    package = ET.parse(ROOT / "package.xml").getroot()
    assert package.findtext("name") == PROJECT["name"]
    assert package.findtext("version") == PROJECT["version"]
    assert package.findtext("description") == PROJECT["description"]
    assert package.findtext("license") == PROJECT["license"]
    assert package.findtext("export/build_type") == "ament_python"
    needed = {element.text for element in package.findall("exec_depend")}
    names = {re.split(r"[<>=!~ ;\[]", line, maxsplit=1)[0] for line in PROJECT["dependencies"]}
    assert {KEYS[name] for name in names - {UNKNOWN}} <= needed
    assert {"rclpy", "action_msgs", "unique_identifier_msgs", "rosidl_parser"} <= needed


# --- colcon ------------------------------------------------------------------------------------


@pytest.mark.heavy
@pytest.mark.skipif(COLCON is None, reason="no colcon here; name one in ACTIONKIT_COLCON")
@pytest.mark.parametrize("how", ["copied", "symlinked"])
def test_colcon_builds_it_and_the_command_runs(how: str, copy: Path, tmp_path: Path) -> None:
    flags = ["--symlink-install"] if how == "symlinked" else []
    # Nothing of the environment of the tests: not its Python packages, not its build backend.
    clean = {k: v for k, v in os.environ.items() if not k.startswith(("PYTHON", "AMENT", "COLCON"))}
    clean["PATH"] = f"{Path(str(COLCON)).parent}:{clean.get('PATH', '')}"
    clean |= {"COLCON_LOG_PATH": str(tmp_path / "log"), "COLCON_HOME": str(tmp_path / "home")}
    done = subprocess.run(
        [str(COLCON), "build", *flags],
        cwd=tmp_path,
        env=clean,
        capture_output=True,
        text=True,
        check=False,
        timeout=200,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    install = tmp_path / "install" / "actionkit"
    assert (install / "share/ament_index/resource_index/packages/actionkit").is_file()
    assert (install / "share/actionkit/package.xml").read_text() == (
        ROOT / "package.xml"
    ).read_text()

    # As a shell that has sourced the workspace runs it: what `ros2 run actionkit actionkit` would.
    script = install / "lib" / "actionkit" / "actionkit"
    assert os.access(script, os.X_OK)
    dependencies = sysconfig.get_paths()["purelib"]
    told = subprocess.run(
        [
            "sh",
            "-c",
            '. install/setup.sh && PYTHONPATH="$PYTHONPATH:$1" && export PYTHONPATH && shift'
            ' && "$@" && echo "$AMENT_PREFIX_PATH" && exec "$0" -c '
            "'import actionkit; print(actionkit.__file__)'",
            sys.executable,
            dependencies,
            sys.executable,
            str(script),
            "show",
            "test_msgs/action/Fibonacci",
        ],
        cwd=tmp_path,
        env=clean,
        capture_output=True,
        text=True,
        check=False,
        timeout=100,
    )
    assert told.returncode == 0, told.stderr
    *goal, prefixes, module = told.stdout.splitlines()
    assert "order: 0  # int32" in goal
    assert str(install) in prefixes.split(":")
    # Not the checkout that the tests run from
    assert Path(module).is_relative_to(tmp_path)
    if how == "symlinked":
        assert (Path(module).resolve()).is_relative_to(copy)
    else:
        assert (install / "lib").rglob("py.typed")
        groups = next(install.rglob("entry_points.txt")).read_text()
        assert "actionkit = actionkit.cli:main" in groups
        assert "actionkit = actionkit.testing.plugin" in groups

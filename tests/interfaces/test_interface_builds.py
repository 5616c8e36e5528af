"""Builds that are repeated, interrupted, at the same time, and in several places."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from actionkit._interfaces.dependencies import RECORD
from tests import forked
from tests.interfaces.conftest import actionkit, environment, run_python, write_package

POINTS = "float64 x\nfloat64 y\n"
SHOW = """
import importlib, sys
module, name = sys.argv[1:3]
cls = getattr(importlib.import_module(module), name)
type(cls).__import_type_support__()
assert type(cls)._TYPE_SUPPORT is not None
print(*cls.get_fields_and_field_types())
"""


def fields(module: str, name: str, *on_path: Path) -> list[str]:
    """The fields of a message, loaded with its libraries in a process of its own."""
    return run_python(SHOW, module, name, env=environment(*on_path)).split()


def built(*words: object, env: dict[str, str] | None = None) -> list[str]:
    """Build, and return what was done, by the lines' words without times and places."""
    done = actionkit("interfaces", "build", *words, env=env)
    assert done.returncode == 0, done.stdout + done.stderr
    return [" ".join(line.split()[:2]) for line in done.stdout.splitlines() if ": " in line[:20]]


@pytest.fixture
def points(shared: Path, tmp_path: Path) -> Path:
    """A folder with a package of one message. Its compiled files are in the cache soon."""
    return write_package(tmp_path / "points", {"msg/Point.msg": POINTS}, version="0.1.0")


@pytest.mark.long
def test_only_what_changed_is_built(shared: Path, tmp_path: Path) -> None:
    sources, out = tmp_path / "sources", tmp_path / "out"
    points = write_package(sources / "zz_points", {"msg/Point.msg": POINTS})
    write_package(sources / "lines", {"msg/Line.msg": "zz_points/Point[] points\n"})
    assert built(sources, "-o", out) == ["zz_points: built", "lines: built"]
    times = {path: path.stat().st_mtime_ns for path in out.rglob("*.so")}
    assert built(sources, "-o", out) == ["zz_points: unchanged,", "lines: unchanged,"]
    assert {path: path.stat().st_mtime_ns for path in out.rglob("*.so")} == times

    (sources / "lines" / "msg" / "Line.msg").write_text("zz_points/Point[] at\n")
    assert built(sources, "-o", out) == ["zz_points: unchanged,", "lines: built"]
    (points / "msg" / "Point.msg").write_text(POINTS + "float64 z\n")
    assert built(sources, "-o", out) == ["zz_points: built", "lines: built"]
    assert fields("zz_points.msg", "Point", out) == ["x", "y", "z"]
    assert fields("lines.msg", "Line", out) == ["at"]

    # A library that somebody removed is not "unchanged".
    next(out.glob("lines/*fastrtps_c.so")).unlink()
    assert built(sources, "-o", out) == ["zz_points: unchanged,", "lines: built"]


@pytest.mark.long
def test_packages_that_were_built_elsewhere(points: Path, tmp_path: Path) -> None:
    there, here = tmp_path / "over, there", tmp_path / "here"
    # Behind a link, the way up leads elsewhere.
    (tmp_path / "a" / "b").mkdir(parents=True)
    here.symlink_to(tmp_path / "a" / "b")
    user = write_package(tmp_path / "lines", {"msg/Line.msg": "points/Point[] points\n"})
    refused = actionkit("interfaces", "build", user, "-o", here)
    assert "the package points cannot be found here" in refused.stderr
    # Compiled again, and not taken from the cache.
    env = environment(XDG_CACHE_HOME=str(tmp_path / "cache"))
    built(points, "-o", there, env=env)
    done = actionkit("interfaces", "build", user, "-o", here, env={**env, "PYTHONPATH": str(there)})
    assert done.returncode == 0, done.stderr
    assert "not by colcon" in done.stderr
    assert "package.xml: add <depend>points</depend>" in done.stderr
    assert fields("lines.msg", "Line", here, there) == ["points"]


@pytest.mark.long
def test_two_builds_at_once(points: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    results: list[list[str]] = []
    threads = [
        threading.Thread(target=lambda: results.append(built(points, "-o", out))) for _ in range(2)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(results) == [["points: built"], ["points: unchanged,"]]
    assert fields("points.msg", "Point", out) == ["x", "y"]


@pytest.mark.long
def test_a_killed_build_leaves_the_old_package(points: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    built(points, "-o", out)
    (points / "msg" / "Point.msg").write_text(POINTS + "float64 killed\n")
    # A compiler that tells that it was called, and then waits for somebody who never comes.
    told, never = tmp_path / "told", tmp_path / "never"
    os.mkfifo(told)
    os.mkfifo(never)
    waiting = tmp_path / "waiting"
    waiting.write_text(f"#!/bin/sh\necho called > {told}\nread nothing < {never}\n")
    waiting.chmod(0o755)
    with forked.Popen(
        [sys.executable, "-m", "actionkit", "interfaces", "build", str(points), "-o", str(out)],
        env=environment(CC=str(waiting), CXX=str(waiting)),
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    ) as process:
        assert told.read_text().startswith("called")
        os.killpg(process.pid, signal.SIGKILL)
    assert list(out.glob(".actionkit-*"))
    assert fields("points.msg", "Point", out) == ["x", "y"]
    assert built(points, "-o", out) == ["points: built"]
    assert fields("points.msg", "Point", out) == ["x", "y", "killed"]
    assert not list(out.rglob(".actionkit-*"))


@pytest.mark.long
def test_what_cannot_be_compiled_or_loaded_changes_nothing(points: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    built(points, "-o", out)
    (points / "msg" / "Point.msg").write_text(POINTS + "float64 w\n")
    words = ("interfaces", "build", points, "-o", out)
    failed = actionkit(*words, env=environment(CFLAGS="--no-such-flag"))
    assert failed.returncode == 1
    assert "--no-such-flag" in failed.stderr
    # Compiles and links, but Python cannot load it.
    env = environment(CFLAGS="-O0 -DPyModule_Create2=missing_from_python")
    failed = actionkit(*words, env=env)
    assert failed.returncode == 1
    assert "was compiled, but Python cannot load it" in failed.stderr
    assert "missing_from_python" in failed.stderr
    assert fields("points.msg", "Point", out) == ["x", "y"]


MEETING = """#!/bin/sh
if mkdir {here}/first 2> /dev/null; then read nothing < {here}/meet
elif mkdir {here}/second 2> /dev/null; then echo > {here}/meet
fi
exec gcc "$@"
"""


@pytest.mark.skipif(len(os.sched_getaffinity(0)) < 2, reason="there is one processor only")
@pytest.mark.long
def test_two_processors_compile_and_progress_is_told(points: Path, tmp_path: Path) -> None:
    # The first two calls of the compiler wait for each other: one alone would wait for ever.
    here = tmp_path / "meeting"
    here.mkdir()
    os.mkfifo(here / "meet")
    compiler = here / "gcc"
    compiler.write_text(MEETING.format(here=here))
    compiler.chmod(0o755)
    env = environment(CC=str(compiler))
    done = actionkit("interfaces", "build", points, "-o", tmp_path / "out", env=env)
    assert done.returncode == 0, done.stderr
    assert (here / "second").is_dir()
    told = re.findall(r"points: building 1 type, (\d+)%", done.stderr)
    assert len(told) == 4
    assert sorted(map(int, told)) == list(map(int, told))
    assert told[0] == "0"


# --- installed -------------------------------------------------------------------------------


def run_in(python: str, *words: object) -> str:
    """Run a program with another Python, and return what it prints."""
    env = environment()
    env.pop("PIP_QUIET", None)  # it is to tell what is installed
    del env["PYTHONPATH"]
    done = forked.run(
        [python, *map(str, words)], env=env, capture_output=True, text=True, cwd="/", check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def files_in(root: Path) -> set[Path]:
    found = {path for path in root.rglob("*") if "__pycache__" not in path.parts}
    return {path for path in found if path.is_file()}


BUILD = ("-m", "actionkit", "interfaces", "build")


CALL = """
from actionkit import Client
from actionkit.testing import FakeServer
from drawing.action import Draw
with FakeServer(Draw, "draw", result={"sum": 3}), Client(Draw, "draw") as client:
    print(client.call({"points": [1, 2]}, timeout=30.0).sum)
"""


def test_an_action_is_built_and_installed_and_called(
    python: str, tmp_path: Path, ros_domain: int
) -> None:
    fields = "int32[] points\n---\nint32 sum\n---\n"
    drawing = write_package(tmp_path / "drawing", {"action/Draw.action": fields})
    wheels = tmp_path / "wheels"
    assert built(drawing, "--wheel", wheels)[0] == "drawing: built"
    (wheel,) = wheels.iterdir()
    run_in(python, "-m", "pip", "install", "--no-index", wheel)
    assert run_in(python, "-c", CALL).split() == ["3"]


@pytest.mark.long
def test_pip_installs_lists_and_uninstalls(points: Path, python: str) -> None:
    root = Path(python).parents[1]
    before = files_in(root)
    assert "points: built" in run_in(python, *BUILD, points, "--install")
    assert run_in(python, "-c", SHOW, "points.msg", "Point").split() == ["x", "y"]
    index = root / "share" / "ament_index" / "resource_index"
    assert (index / "packages" / "points").is_file()
    assert (index / "rosidl_interfaces" / "points").read_text() == "msg/Point.idl\nmsg/Point.msg"
    assert (root / "share" / "points" / "msg" / "Point.msg").read_text() == POINTS
    assert (root / "share" / "points" / "package.xml").is_file()
    assert "points: unchanged" in run_in(python, *BUILD, points, "--install")

    # A new version takes the place of the old one.
    write_package(points, {}, version="0.2.0")
    run_in(python, *BUILD, points, "--install")
    listed = run_in(python, "-m", "pip", "list", "--format=freeze")
    assert [line for line in listed.split() if "points" in line] == ["points==0.2.0+actionkit"]
    run_in(python, "-m", "pip", "check")
    run_in(python, "-m", "pip", "uninstall", "-y", "points")
    assert files_in(root) == before


@pytest.mark.long
def test_a_wheel_declares_what_it_needs_and_works_without_a_compiler(
    points: Path, python: str, tmp_path: Path
) -> None:
    sources, wheels = points.parent, tmp_path / "wheels"
    files = {"action/Draw.action": "points/Point[] at\ngeometry_msgs/Pose pose\n---\n---\n"}
    write_package(sources / "drawing", files, depends="points geometry_msgs")
    done = actionkit("interfaces", "build", sources, "--wheel", wheels)
    assert done.returncode == 0, done.stdout + done.stderr
    names = {path.name.split("-")[0]: path for path in wheels.iterdir()}
    assert sorted(names) == ["drawing", "points"]
    last = done.stdout.splitlines()[-1]
    assert last == f"To install: pip install {names['points']} {names['drawing']}"
    again = built(sources, "--wheel", wheels)
    assert again[:2] == ["points: unchanged,", "drawing: unchanged,"]

    # As on the robot, where everything else is installed already.
    offline = ("-m", "pip", "install", "--no-index")
    refused = forked.run(
        [python, *offline, names["drawing"]], capture_output=True, text=True, check=False
    )
    assert "points==0.1.0+actionkit" in refused.stdout + refused.stderr
    run_in(python, *offline, names["points"], names["drawing"])
    assert run_in(python, "-c", SHOW, "drawing.action._draw", "Draw_Goal").split() == ["at", "pose"]
    run_in(python, "-m", "pip", "check")
    said = "import importlib.metadata as m; print(*m.requires('drawing'))"
    required = run_in(python, "-c", said).split()
    assert sorted(re.sub(r"[\d.]+$", "N", one) for one in required) == [
        "points==0.1.0+actionkit",
        "ros-action-msgs~=N",
        "ros-builtin-interfaces~=N",
        "ros-geometry-msgs~=N",
        "ros-rclpy[fastrtps]~=N",
        "ros-service-msgs~=N",
        "ros-unique-identifier-msgs~=N",
    ]
    # Both are known to a build that uses them.
    user = write_package(tmp_path / "users" / "user", {"msg/User.msg": "points/Point at\n"})
    assert "user: built" in run_in(python, *BUILD, user, "--install")
    assert run_in(python, "-c", SHOW, "user.msg", "User").split() == ["at"]


def test_without_pip_the_error_says_how_to_go_on(
    points: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    from actionkit.cli._app import run

    monkeypatch.setitem(sys.modules, "pip", None)
    assert run(["interfaces", "build", str(points), "--install"]) == 3
    assert "uv pip install wheels/*.whl" in capsys.readouterr().err


@pytest.mark.long
def test_what_pip_refuses_is_told(points: Path, python: str, tmp_path: Path) -> None:
    # Replaces the pip of a system where another program manages the packages.
    broken = tmp_path / "pip"
    (broken / "pip").mkdir(parents=True)
    (broken / "pip" / "__init__.py").touch()
    (broken / "pip" / "__main__.py").write_text("raise SystemExit('externally managed')\n")
    env = environment(broken)
    done = forked.run(
        [python, *BUILD, points, "--install"], env=env, capture_output=True, text=True, check=False
    )
    assert done.returncode == 1
    assert "pip did not install points-0.1.0+actionkit" in done.stderr
    assert "externally managed" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.long
def test_what_a_build_tells_of_itself(own: Path) -> None:
    place = own / "actionkit_interfaces"
    assert (place / RECORD).is_file()
    assert (own / "share" / "COLCON_IGNORE").is_file()
    kinds = {path.suffix for path in (own / "share" / "actionkit_interfaces").rglob("*.*")}
    assert kinds == {".action", ".idl", ".json", ".xml"}

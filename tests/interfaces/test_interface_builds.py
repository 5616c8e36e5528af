"""Builds that are repeated, interrupted, at the same time, and in several places."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from actionkit._interfaces.build_record import FILE
from actionkit._interfaces.publish import put
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
    assert "the package points is not here" in refused.stderr
    # Compiled anew, and not taken from the cache.
    env = environment(XDG_CACHE_HOME=str(tmp_path / "cache"))
    built(points, "-o", there, env=env)
    done = actionkit("interfaces", "build", user, "-o", here, env={**env, "PYTHONPATH": str(there)})
    assert done.returncode == 0, done.stderr
    assert "for colcon, package.xml lacks <depend>points</depend>" in done.stderr
    assert fields("lines.msg", "Line", here, there) == ["points"]


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
    with subprocess.Popen(
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


def test_a_folder_is_replaced_in_one_step(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def made(name: str) -> Path:
        folder = tmp_path / name
        folder.mkdir()
        (folder / "file").write_text(name)
        return folder

    place = tmp_path / "place"
    put(made("old"), place)
    # Two steps, with no package between them, would have to move the old one away first.
    monkeypatch.setattr(Path, "rename", lambda *_: pytest.fail("moved in two steps"))
    put(made("new"), place)
    assert (place / "file").read_text() == "new"


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


# --- installed -------------------------------------------------------------------------------


@pytest.mark.long
def test_installed_listed_and_uninstalled(points: Path, python: str) -> None:
    env = environment()
    env.pop("PIP_QUIET", None)  # it is to tell what is installed
    root = Path(python).parents[1]
    files = {path for path in root.rglob("*") if "__pycache__" not in path.parts}

    def run(*words: str) -> str:
        done = subprocess.run(
            [python, *words], env=env, capture_output=True, text=True, cwd="/", check=False
        )
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    first = run("-m", "actionkit", "interfaces", "build", str(points), "--install")
    assert "points: built" in first
    assert run("-c", SHOW, "points.msg", "Point").split() == ["x", "y"]
    index = root / "share" / "ament_index" / "resource_index"
    assert (index / "packages" / "points").is_file()
    assert (index / "rosidl_interfaces" / "points").read_text() == "msg/Point.idl\nmsg/Point.msg"
    assert (root / "share" / "points" / "msg" / "Point.msg").read_text() == POINTS
    assert (root / "share" / "points" / "package.xml").is_file()
    again = run("-m", "actionkit", "interfaces", "build", str(points), "--install")
    assert "points: unchanged" in again

    # A new version takes the place of the old one.
    write_package(points, {}, version="0.2.0")
    run("-m", "actionkit", "interfaces", "build", str(points), "--install")
    listed = run("-m", "pip", "list", "--format=freeze")
    assert "points==0.2.0" in listed.split()
    run("-m", "pip", "check")
    run("-m", "pip", "uninstall", "-y", "points")
    left = {path for path in root.rglob("*") if "__pycache__" not in path.parts} - files
    assert not [path for path in left if path.is_file()], left


def test_what_a_build_tells_of_itself(own: Path) -> None:
    place = own / "actionkit_interfaces"
    assert (place / FILE).is_file()
    assert (own / "share" / "COLCON_IGNORE").is_file()
    kinds = {path.suffix for path in (own / "share" / "actionkit_interfaces").rglob("*.*")}
    assert kinds == {".action", ".idl", ".json", ".xml"}

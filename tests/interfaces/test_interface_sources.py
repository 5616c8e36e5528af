"""Mistakes in a package are reported with file and line, before anything is made."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

from actionkit._interfaces import dependencies
from actionkit.cli._app import run
from tests.interfaces.conftest import environment, run_python, write_package

GOOD = "int32 goal\n---\nint32 result\n---\nint32 feedback\n"


def build(*words: object, code: int) -> None:
    assert run(["interfaces", "build", *map(str, words)]) == code


def refused(capsys: pytest.CaptureFixture[str], source: Path, *, code: int = 2) -> str:
    """Build, and return the error; nothing may have been made."""
    out = source.parent / "out"
    build(source, "-o", out, code=code)
    assert not out.exists() or [path.name for path in out.glob("*")] == ["share"]
    return capsys.readouterr().err


@pytest.mark.parametrize(
    ("file", "text", "line", "said"),
    [
        ("action/Pick.action", "int32 a\n\nint b\n---\n---\n", 3, "'int': use int32"),
        ("action/Pick.action", "float b\n---\n---\n", 1, "'float': use float32"),
        ("action/Pick.action", "duration b\n---\n---\n", 1, "use builtin_interfaces/Duration"),
        ("action/Pick.action", "int32\n---\n---\n", 1, "a type and a name"),
        ("action/Pick.action", "int32 PickSize\n---\n---\n", 1, "underscores, as pick_size"),
        ("action/Pick.action", "string name;\n---\n---\n", 1, "underscores, as name"),
        ("action/Pick.action", "x float64\n---\n---\n", 1, "no type 'x': write a line as"),
        ("action/Pick.action", "std::string a\n---\n---\n", 1, "use string"),
        ("action/Pick.action", "# a\nint8 a\n# b\nint8 a\n---\n---\n", 4, "taken already, by"),
        ("action/Pick.action", "---\n---\nint8 a\nint8 a\n", 4, "taken already, by line 3"),
        ("action/Pick.action", "int32 class\n---\n---\n", 1, "word of Python"),
        ("action/Pick.action", "int32 default\n---\n---\n", 1, "which ROS generates"),
        ("action/Pick.action", "int32 default\n---\n---\n", 1, "use default_value"),
        ("action/Pick.action", "int32 new\n---\n---\n", 1, "word of C or C++"),
        ("action/Pick.action", "int32 errno\n---\n---\n", 1, "word of C or C++"),
        ("action/Pick.action", "int32 builtins\n---\n---\n", 1, "generated Python code"),
        ("action/Pick.action", "uint8 a 300\n---\n---\n", 1, "integer value"),
        ("action/Pick.action", "int32[<=x] a\n---\n---\n", 1, "int32[<=x] a"),
        ("action/Pick.action", "int32 a\n---\nint32 b\n", 3, "the feedback is missing"),
        ("action/Pick.action", GOOD + "---\n", 6, "one line `---` too many"),
        ("action/Pick.action", "int32 a\n----\n---\n", 2, "with a line `---`"),
        ("action/Pick.action", b"int32 a\r\n\r\n# \xff\r\n---\n---\n", 3, "save it as UTF-8"),
        ("action/Pick.action", "Waypont a\n---\n---\n", 1, "Did you mean Waypoint?"),
        ("action/Pick.action", "Pose a\n---\n---\n", 1, "write geometry_msgs/Pose"),
        ("action/Pick.action", "Header a\n---\n---\n", 1, "use std_msgs/Header"),
        ("action/Pick.action", "Nowhere a\n---\n---\n", 1, "add msg/Nowhere.msg"),
        ("action/Pick.action", "geometry_msgs/Pos a\n---\n---\n", 1, "Did you mean Pose"),
        ("action/Pick.action", "nav2_msgs/Map a\n---\n---\n", 1, "github.com/ros-navigation/"),
        ("action/Pick.action", "---\nint8 A=0\n---\n# x\n\nint8 A=0\n", 6, "result (line 2)"),
        ("srv/Pick.srv", "int8 A=0\n---\nint8 A = 0\n", 3, "add a comment to this line"),
        ("action/Pick.action", "int8 a # C:\\users\\ann\n---\n---\n", 1, r"\users in a comment"),
        ("action/Pick.action", "# to \\\n---\n---\n", 1, "write / in its place"),
        ("action/Pick.action", "float64 b nan\n---\n---\n", 1, "only finite numbers"),
        ("action/Pick.action", "float64 b -inf\n---\n---\n", 1, "only finite numbers"),
        ("action/Pick.action", "float32 b 1e400\n---\n---\n", 1, "only finite numbers"),
        ("action/Pick.action", "float64 B=nan\n---\n---\n", 1, "only finite numbers"),
        ("action/Pick.action", "float64[2] b [1, nan]\n---\n---\n", 1, "only finite numbers"),
        ("action/Pick.action", "---\nint32[] b []\n---\n", 2, "leave [] out"),
        ("action/Pick.action", "int32[<=3] b []\n---\n---\n", 1, "leave [] out"),
        ("action/Pick.action", 'string b "a\\nb"\n---\n---\n', 1, "can have no backslash"),
        ("action/Pick.action", 'string B="a\\\\b"\n---\n---\n', 1, "can have no backslash"),
        ("action/Pick.action", 'string[] b ["\\x"]\n---\n---\n', 1, "can have no backslash"),
        ("action/Pick.action", "geometry_msgs/msg/Pose p\n---\n---\n", 1, "geometry_msgs/Pose,"),
        ("action/Pick.action", "int32 c = 5\n---\n---\n", 1, "without `=`, as `int32 c 5`"),
        ("srv/Pick.srv", "int32 a\n", 1, "the response is missing"),
        ("msg/Pick.msg", "int32 a\n---\n", 2, "a .msg file has one part"),
        ("msg/Waypoint.msg", "Waypoint a\n", None, "Waypoint -> Waypoint"),
        ("action/pick_it.action", GOOD, None, "as PickIt.action"),
        ("msg/HTTPServer.msg", "int32 a\n", None, "HTTPServer.msg: rename one"),
        ("msg/Pick.idl", "module x {};", None, ".idl files are not built here"),
    ],
)  # fmt: skip
@pytest.mark.every
def test_a_bad_line(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    file: str,
    text: str | bytes,
    line: int | None,
    said: str,
) -> None:
    others = {"msg/Waypoint.msg": "float64 x\n", "msg/HttpServer.msg": "int32 a\n"}
    source = write_package(tmp_path / "pick_interfaces", {**others, file: text})
    error = refused(capsys, source)
    place = f"{source / file}:{line}: " if line else str(source)
    assert place in error
    assert said in error


@pytest.mark.long
def test_what_only_looks_wrong_is_built(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = """\
# Kept apart by their comments, as in Nav2's DockRobot; a \\ b and \\"c\\" are no characters.
---

# Of the result
uint16 NONE=0
string a 'it\\'s'
string[] b []
float64 c 1e300
---
# Of the feedback

uint16 NONE=0
"""
    source = write_package(tmp_path / "pick_interfaces", {"action/Pick.action": text})
    build(source, "-o", tmp_path / "out", code=0)
    show = """
from pick_interfaces.action import Pick
print(Pick.Result.NONE, Pick.Feedback.NONE, Pick.Result().a, Pick.Result().b, Pick.Result().c)
"""
    assert run_python(show, env=environment(tmp_path / "out")).strip() == "0 0 it's [] 1e+300"


@pytest.mark.long
def test_what_colcon_would_refuse_is_built_and_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = b"\xef\xbb\xbfint32 a\r\n--- \n  int32 b\n# c\n--- # the feedback\nint32 d # \x0c e\n"
    source = write_package(tmp_path / "pick_interfaces", {"action/Pick.action": text})
    group = "<member_of_group>rosidl_interface_packages</member_of_group>"
    xml = source / "package.xml"
    xml.write_text(xml.read_text().replace(group, ""))
    build(source, "-o", tmp_path / "out", code=0)
    place, told = source / "action" / "Pick.action", "Built here, but not by colcon: "
    lines = capsys.readouterr().err.splitlines()
    assert [line for line in lines if "building 1 type" not in line] == [
        f"{told}{place}:1: save it as UTF-8 without a byte order mark (BOM)",
        f"{told}{place}:2: write `---` alone, without spaces or a comment",
        f"{told}{place}:3: remove the space before it",
        f"{told}{place}:5: write `---` alone, without spaces or a comment",
        f"{told}{place}:6: remove the control character",
        f"{told}{xml}: add {group}",
    ]


def test_all_bad_lines_at_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    files = {"action/Pick.action": "int a\nint8 B\n---\n---\n", "msg/Size.msg": "\n\nfloat x\n"}
    error = refused(capsys, write_package(tmp_path / "pick_interfaces", files))
    assert all(f"{place}: " in error for place in ("Pick.action:1", "Pick.action:2", "Size.msg:3"))


def test_missing_packages_are_told_in_one_line_by_names_that_exist(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    there = dependencies.find
    without = {"geometry_msgs", "std_msgs"}  # as after `pip install -e '.[ros]'`
    monkeypatch.setattr(
        dependencies, "find", lambda name, to: None if name in without else there(name, to)
    )
    uses = "geographic_msgs/GeoPose a\nmy_msgs/It b\ngeometry_msgs/Pose c\nstd_msgs/Header d\n"
    here = tmp_path / "source" / "here"
    free = {"action/Free.action": "Free it\n---\n---\n", "msg/Free.msg": "int32 n\n"}
    write_package(
        here, {"msg/A.msg": "int32 n\n" + uses, "action/B.action": uses + "---\n---\n", **free}
    )
    write_package(tmp_path / "source" / "there", {"action/C.action": "here/A e\n---\n---\n"})
    error = refused(capsys, tmp_path / "source")
    assert error.splitlines() == [
        "Error: here and there: the packages geographic_msgs, geometry_msgs, my_msgs and std_msgs"
        " cannot be found here. pip install ros-jazzy-geometry-msgs ros-jazzy-std-msgs. PyPI is"
        " not known to have geographic_msgs"
        " (https://github.com/ros-geographic-info/geographic_info) or my_msgs: get the source,"
        " put it beside the package that needs it, and build the folder that has both. Or build"
        " single types that do not need them, such as --only action/Free"
    ]


@pytest.mark.long
def test_only_some_types_with_what_they_need(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pick = {
        "action/Pick.action": "Grip grip\nparts/Part part\n---\n---\n",
        "action/Fly.action": "nowhere_msgs/Wings wings\n---\n---\n",
        "msg/Grip.msg": "float64 force\n",
        "msg/Wrong.msg": "nonsense\n",
    }
    source, out = tmp_path / "source", tmp_path / "out"
    write_package(source / "pick_interfaces", pick, depends="parts")
    parts = {"msg/Part.msg": "Size size\n", "msg/Size.msg": "int8 n\n", "srv/Find.srv": "---\n"}
    write_package(source / "parts", parts)
    write_package(source / "others", {"msg/Other.msg": "int8 n\n"})
    build(source, "-o", out, "--only", "action/Pick", code=0)
    show = """
from parts import msg
from pick_interfaces.action import Pick
import pick_interfaces.msg
print(Pick.Goal(), *(name for name in dir(msg) + dir(pick_interfaces.msg) if name[0].isupper()))
"""
    assert run_python(show, env=environment(out)).split(") ", 1)[1] == "Part Size Grip\n"
    assert not (out / "others").exists()
    assert sorted(path.name for path in (out / "share").glob("*/msg/*.msg")) == [
        "Grip.msg",
        "Part.msg",
        "Size.msg",
    ]
    capsys.readouterr()
    build(source, "-o", out, "--only", "parts/msg/Sise", code=2)
    assert capsys.readouterr().err.startswith(
        "Error: --only parts/msg/Sise: there is no such type here."
    )
    build(source, "-o", out, "--only", "action/Pikc", code=2)
    assert "Did you mean action/Pick?" in capsys.readouterr().err


def test_a_package_that_is_missing_for_every_action(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(dependencies, "find", lambda name, to: None)
    source = write_package(tmp_path / "pick_interfaces", {"srv/Ask.srv": "---\n"})
    assert refused(capsys, source) == (
        "Error: pick_interfaces: the packages builtin_interfaces and service_msgs cannot be found"
        " here. pip install ros-jazzy-builtin-interfaces ros-jazzy-service-msgs\n"
    )


@pytest.mark.parametrize(
    ("xml", "said"),
    [
        ("<package><name>pick</name>", "package.xml: no element found"),
        ("<package><name>Pick</name><version>0.1.0</version></package>", "<name> is 'Pick'"),
        ("<package><name>pick</name><version>one</version></package>", "<version> is 'one'"),
        ("<package><name>import</name><version>0.1.0</version></package>", "cannot import"),
        ("<package><name>json</name><version>0.1.0</version></package>", "module of Python itself"),
        (
            "<package><name>test_msgs</name><version>0.1.0</version></package>",
            "'test_msgs' is installed",
        ),
        ("<package><name>numpy</name><version>0.1.0</version></package>", "is installed here"),
    ],
)
def test_a_bad_package_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], xml: str, said: str
) -> None:
    source = tmp_path / "source"
    write_package(source, {"action/Pick.action": GOOD, "package.xml": xml})
    # A name that is taken is no mistake in the sources.
    taken = said in ("module of Python itself", "'test_msgs' is installed", "is installed here")
    assert said in refused(capsys, source, code=1 if taken else 2)


def test_a_circle_of_packages(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for one, other in ("ab", "bc", "ca"):
        files = {f"msg/{one.upper()}.msg": f"{other}_msgs/{other.upper()} it\n"}
        write_package(tmp_path / "source" / f"{one}_msgs", files)
    error = refused(capsys, tmp_path / "source")
    assert "in a circle" in error
    assert all(f"{name}_msgs" in error for name in "abc")


def test_folders_that_are_left_out(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = tmp_path / "source"
    for folder in (".hidden", ".venv", "build", "install", "log", "venv", "ignored"):
        write_package(source / folder / "pick_interfaces", {"action/Pick.action": "nonsense\n"})
    (source / "venv" / "pyvenv.cfg").touch()
    (source / "ignored" / "COLCON_IGNORE").touch()
    write_package(source / "node_package", {"setup.py": ""})  # no interfaces in it
    error = refused(capsys, source)
    assert "there is no interface package here" in error
    assert "<name>source</name>" in error  # a package.xml to copy


def test_files_at_the_wrong_place(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = write_package(tmp_path / "pick_interfaces", {"Pick.action": GOOD})
    assert "Pick.action? That file belongs into the folder action/" in refused(capsys, source)
    assert "no such folder" in refused(capsys, tmp_path / "nowhere")


def test_two_packages_of_one_name(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for folder in ("one", "two"):
        write_package(tmp_path / folder / "pick_interfaces", {"action/Pick.action": GOOD})
    assert "Rename one" in refused(capsys, tmp_path)


# --- where it is built -----------------------------------------------------------------------


@pytest.fixture
def source(tmp_path: Path) -> Path:
    return write_package(tmp_path / "pick_interfaces", {"action/Pick.action": GOOD})


def test_no_compiler(
    source: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", str(source))
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.delenv("CXX", raising=False)
    assert "sudo apt install g++" in refused(capsys, source, code=3)
    monkeypatch.setenv("CXX", "no-such-compiler --flag")
    monkeypatch.setenv("CC", "no-such-compiler")
    assert "CC of the environment names 'no-such-compiler'" in refused(capsys, source, code=3)


def test_no_python_headers(
    source: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("actionkit._interfaces.compile.python_headers", lambda: str(source))
    version = f"{sys.version_info.major}.{sys.version_info.minor}"
    assert f"sudo apt install python{version}-dev" in refused(capsys, source, code=3)


def test_a_sourced_ros_is_left_alone(
    source: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("AMENT_PREFIX_PATH", "/opt/ros/jazzy")
    error = refused(capsys, source, code=1)
    assert "/opt/ros/jazzy" in error
    assert "colcon build" in error


def test_a_target_that_cannot_be_written(source: Path, capsys: pytest.CaptureFixture[str]) -> None:
    build(source, "-o", "/proc/interfaces", code=1)  # not even by root
    assert "/proc/interfaces: nothing can be written here" in capsys.readouterr().err


def test_a_target_that_python_cannot_be_told_of(
    source: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    build(source, "-o", source.parent / "at 12:30", code=2)
    assert "cannot be on PYTHONPATH" in capsys.readouterr().err
    assert not (source.parent / "at 12:30").exists()


def test_a_link_to_nowhere_is_left_alone(source: Path, capsys: pytest.CaptureFixture[str]) -> None:
    link = source.parent / "out" / source.name
    link.parent.mkdir()
    link.symlink_to("/nowhere")
    build(source, "-o", link.parent, code=1)
    assert f"{link}: this is here" in capsys.readouterr().err
    assert os.listdir(link.parent) == [link.name]


def test_sources_are_not_overwritten(source: Path, capsys: pytest.CaptureFixture[str]) -> None:
    build(source, "-o", source.parent, code=1)
    assert f"{source}: this is here" in capsys.readouterr().err
    assert (source / "action" / "Pick.action").read_text() == GOOD


@pytest.mark.parametrize(
    "words", ["", ".", "--own", ". -o x --install", ". --own -o x", ". --install --wheel x"]
)
def test_wrong_usage(words: str, capsys: pytest.CaptureFixture[str]) -> None:
    build(*words.split(), code=2)
    assert "Usage: actionkit interfaces build" in capsys.readouterr().err
    assert not os.path.exists("x")

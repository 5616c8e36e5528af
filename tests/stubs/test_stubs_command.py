"""`actionkit stubs`: the files that it writes and does not touch, and its output (C9.2)."""

from __future__ import annotations

import ast
import os
import shutil
from pathlib import Path

import pytest

from actionkit._stubs.folders import MARK
from actionkit.cli._shared.exits import Exit
from tests.stubs.conftest import Command

AS_OTHERS = ("setpriv", "--bounding-set=-dac_override") if os.geteuid() == 0 else ()
"""Puts a command under the rules of who may write where, which root is above."""


def tree(folder: Path) -> dict[str, str]:
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): path.read_text() for path in files}


@pytest.fixture
def packages(interfaces: Path, tmp_path: Path) -> Path:
    """A copy of plain_interfaces, to install stubs beside it."""
    shutil.copytree(interfaces / "plain_interfaces", tmp_path / "site" / "plain_interfaces")
    return tmp_path / "site"


@pytest.mark.long
def test_two_runs_write_the_same_and_a_type_that_is_gone_leaves_no_file(
    stubs: Command, packages: Path, tmp_path: Path
) -> None:
    assert stubs("plain_interfaces", path=packages).returncode == Exit.OK
    first = tree(tmp_path / "typings")
    assert set(first) == {
        "plain_interfaces/__init__.pyi",
        "plain_interfaces/msg/__init__.pyi",
        "plain_interfaces/msg/_plain.pyi",
        "plain_interfaces/msg/_second.pyi",
    }
    before = (tmp_path / "typings/plain_interfaces/msg/_plain.pyi").stat().st_mtime_ns
    done = stubs("plain_interfaces", path=packages)
    assert "same  typings/plain_interfaces (2 messages)" in done.stdout
    assert tree(tmp_path / "typings") == first
    assert (tmp_path / "typings/plain_interfaces/msg/_plain.pyi").stat().st_mtime_ns == before

    module = packages / "plain_interfaces" / "msg"
    (module / "_second.py").unlink()
    lines = (module / "__init__.py").read_text().splitlines(keepends=True)
    (module / "__init__.py").write_text("".join(line for line in lines if "Second" not in line))
    done = stubs("plain_interfaces", path=packages)
    assert "wrote typings/plain_interfaces (1 message)" in done.stdout
    assert "plain_interfaces/msg/_second.pyi" not in tree(tmp_path / "typings")


@pytest.mark.long
def test_comments_become_docstrings(stubs: Command, packages: Path, tmp_path: Path) -> None:
    file = packages / "share" / "plain_interfaces" / "msg" / "Plain.msg"
    file.parent.mkdir(parents=True)
    file.write_text(
        '''# What is "plain" \\ C:\\new
uint8 STOP = 0  # at once

# of the robot,
# in m
int32 number
string[<=3] words  # """ odd \x07 "
'''
    )
    assert stubs("plain_interfaces", path=packages).returncode == Exit.OK
    text = (tmp_path / "typings/plain_interfaces/msg/_plain.pyi").read_text()
    body = ast.parse(text).body[-1]
    assert isinstance(body, ast.ClassDef)
    assert ast.get_docstring(body) == 'What is "plain" \\ C:\\new\nSTOP = 0  at once'
    names = [ast.unparse(node).partition(":")[0] for node in body.body]
    after = body.body[names.index("number") + 1]
    assert isinstance(after, ast.Expr)
    assert ast.literal_eval(after.value).split() == ["of", "the", "robot,", "in", "m"]
    words = next(n for n in body.body if isinstance(n, ast.FunctionDef) and n.name == "words")
    assert ast.get_docstring(words) == '""" odd   "'


def test_what_is_broken_is_told_and_the_rest_written(stubs: Command, tmp_path: Path) -> None:
    done = stubs("odd_interfaces", "broken_interfaces", "-o", "mine")
    assert done.returncode == Exit.FAILED
    assert "broken_interfaces.msg cannot be imported (SyntaxError: " in done.stderr
    assert "_broken.py, line " in done.stderr
    assert "There is no package 'gone' here" in done.stderr
    assert "odd_interfaces uses it: there its types are `Any`." in done.stderr
    written = tree(tmp_path / "mine")
    assert "odd_interfaces/msg/_odd.pyi" in written
    assert "part: _Any  # odd_interfaces/Part" in written["odd_interfaces/msg/_lost.pyi"]
    assert "builtin_interfaces/msg/_time.pyi" in written  # what actions use
    assert [name for name in written if "broken_interfaces" in name] == [
        "broken_interfaces/__init__.pyi",
        "broken_interfaces/srv/__init__.pyi",
        "broken_interfaces/srv/_whole.pyi",
    ]
    assert "mypy_path = 'mine'" in done.stdout
    assert all(text.startswith(MARK) for text in written.values())


@pytest.mark.long
def test_installed_stubs_go_beside_the_package_and_away_again(
    stubs: Command, packages: Path
) -> None:
    before = tree(packages / "plain_interfaces")
    done = stubs("plain_interfaces", "--install", path=packages)
    assert (done.returncode, done.stderr) == (0, "")
    installed = packages / "plain_interfaces-stubs"
    assert (installed / "py.typed").read_text() == "partial\n"
    assert (installed / "msg" / "_plain.pyi").is_file()
    assert "same " in stubs("plain_interfaces", "--install", path=packages).stdout

    done = stubs("plain_interfaces", "--uninstall", path=packages)
    assert done.stdout == f"removed {installed}\n"
    assert sorted(path.name for path in packages.iterdir()) == ["plain_interfaces"]
    now = {n: t for n, t in tree_text(packages / "plain_interfaces").items() if n in before}
    assert now == before
    done = stubs("plain_interfaces", "--uninstall", path=packages)
    assert (done.returncode, done.stdout) == (0, f"There is no {installed}.\n")


def tree_text(folder: Path) -> dict[str, str]:
    """As `tree`, without what Python caches."""
    files = sorted(p for p in folder.rglob("*") if p.is_file() and "__pycache__" not in p.parts)
    return {path.relative_to(folder).as_posix(): path.read_text() for path in files}


@pytest.mark.parametrize("name", ["msg/_plain.pyi", "notes.txt", "data.bin"])
def test_files_of_others_are_never_touched(
    name: str, stubs: Command, packages: Path, tmp_path: Path
) -> None:
    path = tmp_path / "typings" / "plain_interfaces" / name
    path.parent.mkdir(parents=True)
    path.write_bytes(b"\xff my own\n")
    done = stubs("plain_interfaces", path=packages)
    assert done.returncode == Exit.FAILED
    assert f"{path.relative_to(tmp_path)} is not made by `actionkit stubs`" in done.stderr
    assert "-o DIR" in done.stderr
    assert [p for p in (tmp_path / "typings").rglob("*") if p.is_file()] == [path]
    assert path.read_bytes() == b"\xff my own\n"


@pytest.mark.skipif(
    bool(AS_OTHERS) and shutil.which("setpriv") is None, reason="root may write anywhere"
)
@pytest.mark.long
def test_a_folder_that_cannot_be_written_is_named(
    stubs: Command, packages: Path, tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("")
    done = stubs("plain_interfaces", "-o", "file/below", path=packages)
    assert done.returncode == Exit.FAILED
    assert "stubs cannot be written to file/below (Not a directory). Choose" in done.stderr

    packages.chmod(0o555)
    done = stubs("plain_interfaces", "--install", path=packages, before=AS_OTHERS)
    packages.chmod(0o755)
    assert done.returncode == Exit.FAILED, done.stderr
    assert f"stubs cannot be written to {packages} (Permission denied)." in done.stderr
    assert "-o typings" in done.stderr
    assert sorted(path.name for path in packages.iterdir()) == ["plain_interfaces"]


@pytest.mark.parametrize(
    ("arguments", "code", "told"),
    [
        ((), Exit.USAGE, "Missing argument 'PACKAGE...'"),
        (("plain_interfaces", "-o", "a", "--install"), Exit.USAGE, "exclude each other"),
        (("plain_interfacs",), Exit.NO_ROS, "Did you mean plain_interfaces"),
        (("no/such",), Exit.NO_ROS, "There is no package 'no/such'"),
        (("json",), Exit.NO_ROS, "'json' has no messages, services or actions"),
        (("nowhere", "--uninstall"), Exit.NO_ROS, "There is no package 'nowhere'"),
    ],
)
def test_wrong_arguments_are_refused_before_anything_is_written(
    arguments: tuple[str, ...], code: Exit, told: str, stubs: Command, tmp_path: Path
) -> None:
    done = stubs(*arguments)
    assert done.returncode == code
    assert told in done.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.long
def test_stubs_of_others_for_a_package_that_is_only_used_are_kept(
    stubs: Command, tmp_path: Path
) -> None:
    foreign = tmp_path / "typings" / "service_msgs" / "__init__.pyi"
    foreign.parent.mkdir(parents=True)
    foreign.write_text("MINE: int\n")
    done = stubs("odd_interfaces")
    assert "left  typings/service_msgs/__init__.pyi is not made by `actionkit stubs`" in done.stdout
    assert "service_msgs" not in done.stderr
    assert foreign.read_text() == "MINE: int\n"
    assert (tmp_path / "typings" / "action_msgs" / "msg" / "_goal_status.pyi").is_file()

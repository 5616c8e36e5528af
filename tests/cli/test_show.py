"""`actionkit show`: a goal to fill in, which `actionkit call` accepts (C6.3)."""

from __future__ import annotations

import inspect
import sys
from pathlib import Path
from typing import Any

import pytest
import test_msgs.msg
import yaml
from geometry_msgs.msg import PoseStamped
from test_msgs.action import Fibonacci, NestedMessage

from actionkit._messages.comments import comments, constants, parsed
from actionkit._messages.convert import from_plain
from actionkit.cli._shared.exits import Exit
from actionkit.cli.call import _goal_template
from actionkit.cli.call._goal_template import template
from actionkit.cli.call._goals import parse
from tests.cli.conftest import FIBONACCI, World

MESSAGES = [
    PoseStamped,
    *(cls for _, cls in inspect.getmembers(test_msgs.msg, inspect.isclass)),
]


@pytest.mark.parametrize("action", [Fibonacci, NestedMessage])
def test_what_is_shown_is_a_goal_with_all_defaults(action: Any) -> None:
    shown = template(action, "test_msgs/action/X")
    assert parse(shown, action.Goal) == action.Goal()
    given = yaml.safe_load(shown)
    assert list(given) == list(action.Goal.get_fields_and_field_types())


@pytest.mark.parametrize("cls", MESSAGES, ids=lambda cls: cls.__name__)
def test_every_kind_of_field_is_shown_as_it_is_taken(cls: Any) -> None:
    text = "\n".join(_goal_template._fields(cls()))
    given = yaml.safe_load(text) or {}
    assert set(given) == set(cls.get_fields_and_field_types())
    assert from_plain(cls, given) == cls()


def test_types_bounds_defaults_and_comments_are_shown() -> None:
    shown = "\n".join(_goal_template._fields(PoseStamped()))
    assert "    w: 1.0  # double" in shown
    assert "  stamp:  # builtin_interfaces/Time, or: now" in shown
    assert "# Transform frame with which this data is associated." in shown
    shown = "\n".join(_goal_template._fields(test_msgs.msg.BoundedSequences()))
    assert "int32_values_default: [0, 2147483647, -2147483648]  # sequence<int32, 3>" in shown
    assert "basic_types_values: []  # sequence<test_msgs/BasicTypes, 3>\n# each:\n#   bool" in shown


def test_the_comments_of_a_file() -> None:
    goal, result, feedback = parsed(
        """
# Drive somewhere.

uint8 FAST=2   # at your own risk
# Where to,
# on the map
geometry_msgs/Pose pose
string<=5[<=3] names ["a#b", 'c']  # not "#"

# How fast, in m/s.

float64 speed 1.0  # 0: as it likes
                   # or as it can
---
# How it went
uint16 error_code
---
"""
    )
    assert goal.head == ["Drive somewhere.", "FAST = 2  at your own risk"]
    assert goal.fields == {
        "pose": ["Where to,", "on the map", ""],
        "names": ['not "#"'],
        "speed": ["How fast, in m/s.", "0: as it likes", "or as it can"],
    }
    assert goal.about == ["Drive somewhere."]
    assert result.fields == {"error_code": ["How it went", ""]}
    assert result.about == ["How it went"]
    assert feedback.fields == {}


def test_which_comments_belong_together() -> None:
    (arm,) = parsed(
        """
   # An arm.
#X is forward.

# It moves.

int8 SLOW=12
int8 FAST=2 # at # your own risk
            # or not at all
float64 plain 2.5
# Two # signs.
float64 last  #X of them
"""
    )
    assert arm.about == ["An arm.", "X is forward.", "It moves."]
    assert arm.head[3:] == ["SLOW = 12", "FAST = 2  at # your own risk", "or not at all"]
    assert arm.head[:3] == arm.about
    assert arm.fields == {"plain": [""], "last": ["Two # signs.", "X of them"]}
    (late,) = parsed("float64 a\n# Of b.\nfloat64 b\n")
    assert (late.about, late.fields) == ([], {"a": [""], "b": ["Of b.", ""]})


def test_comments_are_found_beside_a_package_and_where_ros_has_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """`actionkit interfaces build -o` puts the files beside the package, ROS under a prefix."""
    for name, prefix in (("beside_msgs", "python"), ("apart_msgs", "ros")):
        (tmp_path / "python" / name).mkdir(parents=True)
        (tmp_path / "python" / name / "__init__.py").touch()
        file = tmp_path / prefix / "share" / name / "msg" / "Speed.msg"
        file.parent.mkdir(parents=True)
        file.write_text("# Forward,\nfloat64 speed  # in m/s\n")
        monkeypatch.delitem(sys.modules, name, raising=False)  # of an earlier run in this process
    half = tmp_path / "python" / "share" / "beside_msgs" / "action" / "Half.action"
    half.parent.mkdir()
    half.write_text("# A goal.\n", "utf-8-sig")
    monkeypatch.syspath_prepend(tmp_path / "python")
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"{tmp_path / 'nothing'}:{tmp_path / 'ros'}")
    for name in ("beside_msgs", "apart_msgs"):
        assert comments(f"{name}/msg/Speed") == {"": "Forward,", "speed": "Forward, in m/s"}
    assert comments("beside_msgs/action/Half_Goal") == {"": "A goal."}
    for nothing in ("action/Half_Result", "action/Half_SendGoal_Request", "msg/Nowhere"):
        assert comments(f"beside_msgs/{nothing}") == {"": ""}


def test_constants_are_one_line() -> None:
    told = constants(test_msgs.msg.Constants)
    assert told.startswith("BOOL_CONST=True, BYTE_CONST=b'2', CHAR_CONST=100, FLOAT32_CONST=1.125,")
    assert constants(test_msgs.msg.Empty) == constants(int) == ""


def test_it_can_be_piped_into_a_call(world: World) -> None:
    world.server("fibonacci")
    shown = world.run("show", "test_msgs/Fibonacci")
    assert (shown.code, shown.err) == (Exit.OK, "")
    assert "order: 0  # int32" in shown.out
    assert "# Result:\n#   # result definition\n#   sequence: []  # sequence<int32>" in shown.out
    goal = shown.out.replace("order: 0", "order: 4")
    done = world.run_apart("call", "fibonacci", FIBONACCI, "--stdin", stdin=goal)
    assert done.code == Exit.OK, done.err
    assert "sequence: [0, 1, 1, 2, 3]" in done.out

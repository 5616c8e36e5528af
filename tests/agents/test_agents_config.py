"""A toolbox's configuration: one error has all problems, each with its place."""

from __future__ import annotations

import math
import pickle
import sys
from pathlib import Path
from types import MappingProxyType
from typing import Any

import pytest

from actionkit.agents import ConfigError, Toolbox
from actionkit.agents._configuration.config import ActionConfig, read_config, read_file
from tests import forked
from tests.agents.test_agents_arguments import goal_model

NESTED = "test_msgs/action/NestedMessage"
RIGHT = """
domain_id = 7
[tools.drive]
action = "/drive"
type = "test_msgs/action/NestedMessage"
description = "Drives."
timeout = 120.0
concurrent = 2
confirm = "always"
retries = 0
[tools.drive.fields."nested_field.float64_value"]
minimum = 0.5
maximum = 2
description = "Metres."
[tools.drive.fields."nested_field.int32_value"]
const = 3
[tools.drive.fields.nested_different_pkg]
expose = true
[topics.battery]
topic = "/battery_state"
type = "sensor_msgs/msg/BatteryState"
max_age = 5
"""


def problems(config: Any) -> list[str]:
    with pytest.raises(ConfigError) as caught:
        read_config(config, "robot.toml")
    assert str(caught.value) == "\n".join(caught.value.problems)
    return list(caught.value.problems)


def tool(fields: Any = None, **more: Any) -> dict[str, Any]:
    listed = {"nested_field.bool_value": {}} if fields is None else fields
    return {"tools": {"t": {"action": "a", "type": NESTED, "fields": listed, **more}}}


def read(fields: Any) -> ActionConfig:
    return read_config(tool(fields)).tools["t"]


def test_a_file(tmp_path: Path) -> None:
    path = tmp_path / "robot.toml"
    path.write_text(RIGHT, "utf-8-sig")  # as some editors write it
    config = read_file(path)
    assert config.domain_id == 7
    (drive,) = config.tools.values()
    assert (drive.name, drive.timeout, drive.concurrent) == ("drive", 120.0, 2)
    assert (drive.confirm, drive.retries) == ("always", 0)
    assert config.topics["battery"].max_age == 5.0
    assert read({"nested_field.bool_value": {}}).confirm == "never"
    toolbox = Toolbox.from_file(path, domain_id=9)
    assert toolbox.domain_id == 9
    assert [(one.name, one.kind) for one in toolbox.tools] == [
        ("drive", "action"),
        ("battery", "topic"),
        ("goals", "goals"),
    ]
    fields = toolbox.tools[0].input_schema["properties"]
    assert set(fields) == {"nested_field", "nested_different_pkg"}
    assert set(fields["nested_field"]["properties"]) == {"float64_value"}
    assert set(fields["nested_different_pkg"]["properties"]) == {"sec", "nanosec"}
    # Its default, 0, is outside of the limits: the model must say how far.
    assert fields["nested_field"]["required"] == ["float64_value"]


def test_a_file_that_is_no_toml(tmp_path: Path) -> None:
    path = tmp_path / "robot.toml"
    path.write_text("[tools.x\n")
    with pytest.raises(ConfigError, match=r"robot\.toml: this is not TOML: .*line 1"):
        Toolbox.from_file(path)
    path.write_text(f"domain_id = {'9' * 5000}")
    with pytest.raises(ConfigError, match="not TOML"):
        Toolbox.from_file(path)
    path.write_bytes(b"\xff")
    with pytest.raises(ConfigError, match="not TOML"):
        Toolbox.from_file(path)
    with pytest.raises(OSError, match=r"no\.toml"):
        Toolbox.from_file(tmp_path / "no.toml")


def test_every_problem_is_told_with_its_place() -> None:
    config = {
        "domain_id": 233,
        "tols": {},
        "tools": {
            "goals": {"action": "a", "type": NESTED},
            "a b": {"action": "a", "type": NESTED},
            "one": {"action": "9 lives", "type": "test_msgs/msg/Empty", "timeout": "long"},
            "two": {"type": "test_msgs/action/Fibonaci", "confirm": "maybe", "concurent": 2},
            "three": {"action": "x", "type": "nope_msgs/action/Nope", "retries": -1},
            "four": 4,
            "five": {"action": "a", "type": NESTED, "timeout": 10**400},
        },
        "topics": {"one": {"topic": "/t", "type": NESTED, "max_size": 0, "max_age": 0}},
    }
    text = "\n".join(problems(config))
    for part in (
        "robot.toml: domain_id: 233 is outside of 0 to 232",
        "robot.toml: there is no key 'tols'; did you mean 'tools'? the keys are: domain_id, tools",
        "robot.toml: tools.goals: the name 'goals' is taken",
        "robot.toml: tools.a b: a tool's name has",
        "robot.toml: tools.one.action: '9 lives' is not a ROS name",
        "robot.toml: tools.one.type: 'test_msgs/msg/Empty' is not an action type: one is",
        "robot.toml: tools.one.timeout: 'long' must be a number",
        "robot.toml: tools.two.action: must be given",
        "robot.toml: tools.two.type: the package 'test_msgs' has no action 'Fibonaci'. Did you mean"
        " test_msgs/action/Fibonacci?",
        "robot.toml: tools.two.confirm: 'maybe' must be 'never' or 'always'",
        "robot.toml: tools.two: there is no key 'concurent'; did you mean 'concurrent'?",
        "robot.toml: tools.three.type: the package 'nope_msgs' is not installed here",
        "robot.toml: tools.three.retries: -1 is outside of 0 to 1000",
        "robot.toml: tools.four: 4 must be a table",
        "robot.toml: tools.five.timeout: 1000",
        f"robot.toml: topics.one.type: '{NESTED}' is not a message type",
        "robot.toml: topics.one.max_size: 0 is outside of 1 to 100000",
        "robot.toml: topics.one.max_age: 0 must be above 0",
    ):
        assert part in text


@pytest.mark.parametrize(
    ("fields", "part"),
    [
        ({"nested_field.float64_value": {"minimum": 10**400}}, "is outside of -1.79769e+308"),
        ({"nested_feld": {}}, "fields.nested_feld: the goal has no such field; did you mean"),
        (
            {"nested_field": {"minimum": 1}},
            "minimum: is for numbers, but this field is a test_msgs",
        ),
        ({"nested_field.bool_value": {"maximum": 1}}, "maximum: is for numbers"),
        ({"nested_field.int8_value": {"max_length": 1}}, "max_length: is for strings"),
        ({"nested_field.int8_value": {"max_items": 1}}, "max_items: is for arrays"),
        ({"nested_field.int8_value": {"maximum": 128}}, "128 is outside of -128 to 127"),
        ({"nested_field.int8_value": {"maximum": 1.5}}, "1.5 must be a whole number"),
        (
            {"nested_field.int8_value": {"maximum": float("nan")}},
            "NaN must be a whole number, and finite",
        ),
        ({"nested_field.int8_value": {"maximum": True}}, "true must be a whole number"),
        (
            {"nested_field.int8_value": {"minimum": 2, "maximum": 1}},
            "maximum: 1 is below the minimum 2",
        ),
        ({"nested_field.int8_value": {"enum": []}}, "enum: must not be empty"),
        ({"nested_field.int8_value": {"enum": [1, 999]}}, "enum: 999 is outside of -128 to 127"),
        ({"nested_field.int8_value": {"enum": [1, 1]}}, "names a value twice"),
        ({"nested_field.int8_value": {"const": "x"}}, "const: 'x' must be a whole number"),
        ({"nested_field.int8_value": {"const": 1, "maximum": 2}}, "has no meaning beside const"),
        ({"nested_field.int8_value": {"default": 9, "maximum": 2}}, "default: 9 is outside of"),
        ({"nested_field.int8_value": {"expose": 1}}, "expose: 1 must be true or false"),
        ({"nested_field.int8_value": {"expose": False, "minimum": 1}}, "set a default"),
        ({"nested_field.int8_value": {"describtion": ""}}, "did you mean 'description'?"),
        ({"nested_field": {"const": {"nope": 1}}}, "const: there is no field 'nope'"),
        ({"nested_field": {"default": {}}}, "default: is for single fields and arrays"),
        (
            {"nested_field": {"const": {}}, "nested_field.int8_value": {"maximum": 1}},
            "has no effect, because 'nested_field' has a const",
        ),
        (
            {"nested_field.float32_value": {"minimum": 0.1, "maximum": 0.1}},
            "no float lies within 0.1 to 0.1",
        ),
        ({"nested_field.int8_value": 1}, "1 must be a table"),
        ({"nested_field.int8_value": {"enum": [1, 9], "maximum": 5}}, "enum: 9 is outside of -128"),
        (
            {"nested_field.float32_value": {"enum": [0.1], "minimum": 0.1, "maximum": 0.1}},
            "no float lies within 0.1 to 0.1",
        ),
        ({"nested_field.int8_value": {"required": 1}}, "required: 1 must be true or false"),
        (
            {"nested_field.int8_value": {"required": True, "default": 1}},
            "required: a field that must be given has no default",
        ),
        ({"nested_field.int8_value": {"required": True, "const": 1}}, "required: has no meaning"),
        (
            {"nested_field.int8_value": {"required": True, "expose": False}},
            "required: is not exposed, so a model cannot give it",
        ),
        (
            {"nested_field": {"required": True}, "nested_field.int8_value": {"const": 1}},
            "nested_field.required: is not exposed",
        ),
        (
            {"nested_field": {"description": "Where."}},
            "a model cannot set anything in it: list the fields in it, such as"
            " 'nested_field.bool_value', or set expose = true",
        ),
        (
            {"nested_field": {"int8_value": {"maximum": 1}}},
            'fields.nested_field: a path needs quotes: [tools.t.fields."nested_field.int8_value"]',
        ),
        (
            {"nested_field.int8_value": {}, "nested_field[].int8_value": {}},
            "this field is listed twice",
        ),
        (
            {},
            "robot.toml: tools.t.fields: no field of the goal is listed, so a model could set none."
            " List those that it may set, such as"
            ' [tools.t.fields."nested_field_no_pkg.duration_value.sec"],'
            ' or set expose = "all" for all of them',
        ),
    ],
)
def test_limits_that_contradict_the_type(fields: Any, part: str) -> None:
    assert part in "\n".join(problems(tool(fields)))


def test_what_else_is_wrong() -> None:
    assert "there are no tools" in problems({})[0]
    assert "must be a table" in problems([])[0]
    assert "must be a table" in problems({"tools": []})[0]
    twice = tool()
    twice["topics"] = {"t": {"topic": "/t", "type": "test_msgs/msg/Empty"}}
    assert "rename one" in problems(twice)[0]
    types = tool()
    types["tools"]["u"] = {"action": "a", "type": "test_msgs/action/Fibonacci", "expose": "all"}
    assert "has the type" in problems(types)[0]
    assert "above 0" in problems(tool(timeout=0))[0]
    with pytest.raises(ConfigError, match="domain_id"):
        Toolbox.from_config(tool(), domain_id=-1)
    error = ConfigError(("one", "two"))  # it may come from another process
    again = pickle.loads(pickle.dumps(error))
    assert (str(again), again.problems) == ("one\ntwo", error.problems)
    assert repr(again) == "ConfigError(('one', 'two'))"


def test_what_only_python_can_write() -> None:
    fields = {"nested_field.bool_value": {}, 2: {}, "nested_field": {"a\ud800": {"b": {}}}}
    config: Any = tool(MappingProxyType(fields), timeout=math.nan)
    config["tools"]["t"] |= {3: 4, "retries": None, "concurrent": True}
    config["tools"][None] = {}
    assert set(problems(MappingProxyType({**config, "topics": None}))) == {
        "robot.toml: tools.t.timeout: NaN must be a number, and finite",
        "robot.toml: tools.t.retries: null is not allowed; leave the key out to keep its default",
        "robot.toml: tools.t.concurrent: true must be a whole number",
        "robot.toml: tools.t.fields: the name 2 must be a string",
        "robot.toml: tools.t.fields.nested_field: a path needs quotes:"
        ' [tools.t.fields."nested_field.a\\ud800.b"]',
        "robot.toml: tools.t: the name 3 must be a string",
        "robot.toml: tools: the name None must be a string",
        "robot.toml: tools.None.type: must be given",
        "robot.toml: tools.None.action: must be given",
    }


def test_all_that_is_wrong_with_one_field_is_told() -> None:
    limits = {"const": [1, "x"], "enum": [], "maxmum": 1, "max_length": -1, "required": 0}
    fields = {"nested_field.int8_value": limits, "nested_field_no_pkg": {"const": {"a": 1, "b": 2}}}
    found = [one.removeprefix("robot.toml: tools.t.fields.") for one in problems(tool(fields))]
    whole = '"nested_field.int8_value"'
    beside = "has no meaning beside const; remove one of them"
    assert sorted(found) == sorted(
        [
            *(f"{whole}.{key}: {beside}" for key in ("enum", "max_length", "required")),
            f"{whole}.const: an array was given; this must be a whole number",
            f"{whole}.enum: must not be empty",
            f"{whole}.max_length: -1 is outside of 0 to {sys.maxsize}",
            f"{whole}.required: 0 must be true or false",
            f"{whole}: there is no key 'maxmum'; did you mean 'maximum'? the keys are: minimum,"
            " maximum, max_length, max_items, enum, const, default, description, expose, required",
            *(
                f"nested_field_no_pkg.const: there is no field '{name}'; the fields are:"
                " duration_value, time_value"
                for name in "ab"
            ),
        ]
    )


def test_a_part_of_something_hidden_may_be_shown() -> None:
    fields = {"nested_field": {"expose": False}, "nested_field.bool_value": {"expose": True}}
    properties = read(fields).fields.schema["properties"]
    assert list(properties["nested_field"]["properties"]) == ["bool_value"]


def properties(config: Any) -> dict[str, Any]:
    found: dict[str, Any] = read_config(config).tools["t"].fields.schema["properties"]
    return found


def test_only_what_is_listed_is_exposed() -> None:
    x, y = {"minimum": 0.0, "maximum": 1.0}, {"const": 2.0}
    only = tool({"nested_field.float64_value": x, "nested_field.float32_value": y})
    (config,) = read_config(only).tools.values()
    shown = config.fields.schema["properties"]
    assert set(shown) == {"nested_field"}
    assert set(shown["nested_field"]["properties"]) == {"float64_value"}
    for arguments in (
        {"nested_field": {"int8_value": 1}},
        {"nested_field": {"float32_value": 2.0}},
        {"nested_different_pkg": {}},
    ):
        assert "there is no field" in config.fields.check(arguments)[1][0]
    sent, _ = config.fields.check({"nested_field": {"float64_value": 1}})
    assert sent == {"nested_field": {"float64_value": 1.0, "float32_value": 2.0}}
    whole = {"nested_field.float64_value": x, "nested_different_pkg": {"expose": True}}
    assert set(properties(tool(whole))["nested_different_pkg"]["properties"]) == {"sec", "nanosec"}
    everything = properties(tool({"nested_field.float64_value": x}, expose="all"))
    assert set(everything) == {"nested_field", "nested_field_no_pkg", "nested_different_pkg"}
    assert "expose: 'none' must be 'listed' or 'all'" in problems(tool(expose="none"))[0]


def test_a_goal_that_no_model_can_change() -> None:
    assert properties(tool({"nested_field.int8_value": {"const": 1}})) == {}
    assert properties(tool({"nested_field": {"expose": False}})) == {}


def test_parts_of_arrays_are_exposed_as_they_are_listed() -> None:
    limits = {"poses.pose.position.x": {"minimum": 0.0, "maximum": 1.0}}
    path = goal_model("nav_msgs.msg:Path", limits, expose_all=False)
    assert set(path.schema["properties"]) == {"poses"}
    pose = {"pose": {"position": {"x": 0.5}}}
    assert path.check({"poses": [pose, {}]}) == ({"poses": [pose, {}]}, [])
    pose["pose"]["position"]["y"] = 0.5
    assert "poses[0].pose.position: there is no field 'y'" in path.check({"poses": [pose]})[1][0]


def test_required_fields_must_be_given() -> None:
    needed = {"minimum": -1.0, "maximum": 1.0, "required": True}
    model = read({"nested_field.float64_value": needed}).fields
    assert model.schema["required"] == ["nested_field"]
    assert model.schema["properties"]["nested_field"]["required"] == ["float64_value"]
    for arguments in ({}, {"nested_field": {}}):
        assert model.check(arguments)[1] == ["nested_field.float64_value: must be given"]
    assert model.check({"nested_field": {"float64_value": 0.0}})[1] == []
    whole = read({"nested_different_pkg": {"required": True, "expose": True}}).fields
    assert whole.check({})[1] == ["nested_different_pkg: must be given"]
    assert whole.check({"nested_different_pkg": {}})[1] == []


def test_numbers_without_limits_are_warned_of(caplog: pytest.LogCaptureFixture) -> None:
    fields = {
        "nested_field.float64_value": {"maximum": 1.0},
        "nested_field.float32_value": {"minimum": 0.0, "maximum": 1.0},
        "nested_field.int8_value": {"enum": [1, 2]},
        "nested_field.int16_value": {"const": 1},
        "nested_field.bool_value": {},
        "nested_different_pkg.sec": {},
    }
    read_config(tool(fields, expose="listed"))
    (record,) = caplog.records
    assert record.getMessage() == (
        "configuration: tools.t: numbers without limits: nested_field.float64_value,"
        " nested_different_pkg.sec; set minimum and maximum, or enum"
    )
    caplog.clear()
    del fields["nested_field.float64_value"], fields["nested_different_pkg.sec"]
    read_config(tool(fields, expose="listed"))
    assert caplog.records == []


def test_files_that_do_not_say_what_is_exposed_are_warned_of(
    caplog: pytest.LogCaptureFixture,
) -> None:
    fields: dict[str, Any] = {
        "nested_field.bool_value": {},
        "nested_field.int8_value": {"const": 1},
        "nested_field_no_pkg": {"expose": False},
        "nested_different_pkg": {"expose": False},
    }
    read(fields)
    assert "configuration: tools.t: 11 fields are not listed" in caplog.text
    caplog.clear()
    read({**fields, "nested_field": {"expose": False}, "nested_field.bool_value": {"expose": True}})
    read_config(tool(fields, expose="listed"))
    assert caplog.records == []


@pytest.mark.long
def test_a_file_is_checked_without_serving_it(tmp_path: Path) -> None:
    path = tmp_path / "robot.toml"
    path.write_text(RIGHT)
    command = [sys.executable, "-m", "actionkit", "mcp", "--check", str(path)]
    done = forked.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0
    for part in (
        "drive: Drives. A human is asked to approve each goal.",
        "  Numbers without limits: nested_different_pkg.sec, nested_different_pkg.nanosec\n",
        "  Not exposed: nested_field_no_pkg.duration_value.sec, ",
        '"description": "Metres."',
        "battery: ",
        "goals: ",
    ):
        assert part in done.stdout
    assert "robot.toml: tools.drive: numbers without limits: nested_dif" in done.stderr
    path.write_text(RIGHT.replace('fields."nested_field.float64_value"', "fields.nested_field.x"))
    done = forked.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 2
    assert done.stdout == ""
    assert 'a path needs quotes: [tools.drive.fields."nested_field.x"]' in done.stderr

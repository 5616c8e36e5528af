"""Arguments are checked against limits, independent of the schema; schemas fit arguments."""

from __future__ import annotations

import importlib
import json
import math
import random
import struct
import time
from typing import Any

import jsonschema
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from actionkit._messages.convert import from_plain, to_plain
from actionkit._model.similar_names import similar_names
from actionkit.agents._arguments.argument_size import check_size
from actionkit.agents._arguments.goal_model import GoalModel
from actionkit.agents._configuration.config_fields import read_fields

CLASSES = [
    "test_msgs.action:NestedMessage.Goal",
    "test_msgs.msg:Arrays",
    "test_msgs.msg:BoundedSequences",
    "test_msgs.msg:Constants",
    "test_msgs.msg:Defaults",
    "test_msgs.msg:Empty",
    "test_msgs.msg:MultiNested",
    "test_msgs.msg:Strings",
    "test_msgs.msg:UnboundedSequences",
    "test_msgs.msg:WStrings",
    "geometry_msgs.msg:PoseStamped",
    "nav_msgs.msg:Path",
    "sensor_msgs.msg:BatteryState",
]


def message_class(name: str) -> Any:
    module, _, path = name.partition(":")
    found: Any = importlib.import_module(module)
    for part in path.split("."):
        found = getattr(found, part)
    return found


def goal_model(name: str, fields: Any = None, *, expose_all: bool = True) -> GoalModel:
    return read_fields(message_class(name), fields or {}, expose_all=expose_all)


# --- schemas -----------------------------------------------------------------------------------


def instances(schema: Any) -> st.SearchStrategy[Any]:
    """Return the instances that a schema of ours allows."""
    if "enum" in schema:
        return st.sampled_from(schema["enum"])
    kind = schema["type"]
    if kind == "object":
        fields = {name: instances(one) for name, one in schema["properties"].items()}
        needed = schema.get("required", ())
        return st.fixed_dictionaries(
            {name: one for name, one in fields.items() if name in needed},
            optional={name: one for name, one in fields.items() if name not in needed},
        )
    if kind == "array":
        least, most = schema.get("minItems", 0), schema.get("maxItems")
        items = instances(schema["items"])
        return st.lists(
            items, min_size=least, max_size=max(least, min(2, 2 if most is None else most))
        )
    if kind == "string":
        letters = st.characters(exclude_categories=["Cs"], exclude_characters="\0")
        return st.text(letters, max_size=min(schema.get("maxLength", 5), 30))
    if kind == "boolean":
        return st.booleans()
    low, high = schema["minimum"], schema["maximum"]
    if kind == "integer":
        return st.integers(low, high) | st.integers(low, high).map(float).filter(
            lambda value: low <= value <= high
        )
    return st.floats(low, high)


@pytest.mark.parametrize("name", CLASSES)
def test_schemas_are_right_and_their_instances_fit_the_message(name: str) -> None:
    cls = message_class(name)
    goal = goal_model(name)
    schema = json.loads(json.dumps(goal.schema))
    jsonschema.Draft202012Validator.check_schema(schema)
    validator = jsonschema.Draft202012Validator(schema)

    @settings(max_examples=15, deadline=None, database=None)
    @given(instances(schema))
    def fits(arguments: Any) -> None:
        assert validator.is_valid(arguments)
        fields, problems = goal.check(arguments)
        # The one thing that a schema cannot say: it counts characters, and ROS counts bytes.
        problems = [one for one in problems if "bytes of UTF-8" not in one and "16-bit" not in one]
        assert problems == []
        from_plain(cls, fields)

    fits()


JUNK: list[Any] = [
    *(None, True, False, 0, 1, -1, 256, 2**31, 2**53 + 1, 2**64, 10**400, 10**5000),
    *(0.1, 1.5, -0.0, 1e-46, 1e308, 3.5e38, math.nan, math.inf, -math.inf),
    *("", "a", "1", "ü" * 12, "a\0b", "\ud800", "x" * 40),
    *([], [1], [None], [[]], {}, {"x": 1}, {"\ud800": 1}, {"a\u200b": 1}, [{}]),
]
LIMITED: list[tuple[str, dict[str, Any]]] = [
    *((name, {}) for name in CLASSES),
    (
        "nav_msgs.msg:Path",
        {
            "poses": {"max_items": 2},
            "poses.pose.position.x": {"minimum": 1.0, "maximum": 2.0},
            "poses.header.frame_id": {"const": "map"},
        },
    ),
    (
        "test_msgs.msg:MultiNested",
        {
            "array_of_arrays.int32_values": {"minimum": 4},
            "array_of_arrays.bool_values": {"const": [True, False, True]},
            "array_of_arrays.basic_types_values.float32_value": {"default": 0.1, "maximum": 0.1},
            "array_of_arrays.string_values": {"enum": ["", "a"]},
        },
    ),
]


def spoilt(chance: random.Random, schema: Any) -> Any:
    """Return arguments for a schema, with something in its place that may be wrong, or not."""
    if chance.random() < 0.02:
        return chance.choice(JUNK)
    if "enum" in schema:
        return chance.choice(schema["enum"])
    kind = schema["type"]
    if kind == "object":
        some = chance.sample(list(schema["properties"]), min(2, len(schema["properties"])))
        names = sorted({*schema.get("required", ()), *some[: chance.randint(0, 2)]})
        found = {name: spoilt(chance, schema["properties"][name]) for name in names}
        if chance.random() < 0.02:
            found[chance.choice(["nope", "", "x\u202e", "a.b", "\ud800"])] = 1
        return found
    if kind == "array":
        least = schema.get("minItems", 0)
        count = chance.choice([least, least, min(least + 1, schema.get("maxItems", 9)), least + 2])
        return [spoilt(chance, schema["items"]) for _ in range(count)]
    if kind == "string":
        return "x" * chance.choice([0, 1, 22, 23])
    if kind == "boolean":
        return chance.random() < 0.5
    low, high = schema["minimum"], schema["maximum"]
    if kind == "integer":
        near = [low - 1, low, high, high + 1, float(low), 1.5]
        return chance.choice(near) if chance.random() < 0.05 else chance.randint(low, high)
    near = [math.nextafter(low, -math.inf), low, high, math.nextafter(high, math.inf)]
    return chance.choice(near) if chance.random() < 0.05 else chance.uniform(low / 2, high / 2)


@pytest.mark.parametrize(("name", "fields"), LIMITED)
def test_what_is_accepted_fits_the_schema_and_the_message(name: str, fields: Any) -> None:
    seed = random.randrange(2**32)
    chance = random.Random(seed)
    cls, goal = message_class(name), goal_model(name, fields)
    validator = jsonschema.Draft202012Validator(goal.schema)
    accepted = 0
    for _ in range(300):
        arguments = spoilt(chance, goal.schema)
        sent, problems = goal.check(arguments)
        assert len("".join(problems)) < 5000, (seed, arguments)
        if not problems:
            accepted += 1
            assert validator.is_valid(arguments), (seed, arguments)
            message = from_plain(cls, sent)
            given = {name: sent[name] for name in goal.schema["properties"] if name in sent}
            _, problems = goal.check(without_constants(goal.schema, given))
            assert problems == [], (seed, arguments, message)
    assert accepted, seed


def without_constants(schema: Any, sent: Any) -> Any:
    """Return what was sent, but for what no model can set."""
    if isinstance(sent, list):
        return [without_constants(schema["items"], item) for item in sent]
    if not isinstance(sent, dict):
        return sent
    below = schema["properties"]
    return {n: without_constants(below[n], value) for n, value in sent.items() if n in below}


def test_a_schema_with_limits_comments_and_constants() -> None:
    pose = goal_model(
        "geometry_msgs.msg:PoseStamped",
        {
            "header.frame_id": {"const": "map"},
            "header": {"expose": False},
            "pose.position.x": {"minimum": 1.0, "maximum": 2.0},
            "pose.orientation": {"expose": False},
            "pose.position.z": {"const": 0.0},
        },
    ).schema
    assert pose["required"] == ["pose"]
    assert set(pose["properties"]) == {"pose"}
    position = pose["properties"]["pose"]["properties"]["position"]
    assert set(position["properties"]) == {"x", "y"}
    assert position["required"] == ["x"]
    assert "free space" in position["description"]
    battery = goal_model("sensor_msgs.msg:BatteryState").schema
    assert "Voltage in Volts" in battery["properties"]["voltage"]["description"]
    assert "POWER_SUPPLY_STATUS_CHARGING=1" in battery["description"]


# --- what is sent ------------------------------------------------------------------------------


def test_defaults_and_constants_are_sent_and_others_keep_the_messages_own() -> None:
    pose = goal_model(
        "geometry_msgs.msg:PoseStamped",
        {
            "header.frame_id": {"const": "map"},
            "pose.position.x": {"default": 1.5},
            "pose.orientation": {"const": {"w": 0.5}},
        },
    )
    fields, problems = pose.check({})
    assert problems == []
    assert fields == {
        "header": {"frame_id": "map"},
        "pose": {"position": {"x": 1.5}, "orientation": {"w": 0.5}},
    }
    _, problems = pose.check({"header": {"frame_id": "odom"}})
    assert "there is no field 'frame_id'" in problems[0]


def test_the_default_of_a_hidden_array_has_its_constants_and_limits() -> None:
    fields = {
        "poses": {"default": [{"pose": {"position": {"x": 1.0}}}]},
        "poses.header.frame_id": {"const": "map"},
        "poses.pose.position.x": {"maximum": 2.0, "expose": False},
    }
    path = goal_model("nav_msgs.msg:Path", fields, expose_all=False)
    assert path.schema["properties"] == {}
    sent = {"header": {"frame_id": "map"}, "pose": {"position": {"x": 1.0}}}
    assert path.check({}) == ({"poses": [sent]}, [])
    fields["poses.pose.position.x"]["maximum"] = 0.5
    with pytest.raises(ValueError, match=r"\[0\].pose.position.x: 1.0 is outside of") as caught:
        read_fields(message_class("nav_msgs.msg:Path"), fields, expose_all=False)
    assert caught.value.errors()[0]["loc"] == ("poses", "default")


@pytest.mark.parametrize(
    ("name", "path", "limit", "text"),
    [
        ("Arrays", "bool_values", {"max_items": 2}, "this array always has 3 elements"),
        ("BoundedSequences", "bool_values", {"max_items": 4}, "4 is more than the type allows, 3"),
        ("Strings", "bounded_string_value", {"max_length": 23}, "more than the type allows, 22"),
    ],
)
def test_limits_wider_than_the_type(name: str, path: str, limit: Any, text: str) -> None:
    with pytest.raises(ValueError, match=text):
        goal_model(f"test_msgs.msg:{name}", {path: limit})


def test_limits_of_whole_numbers_may_be_written_as_floats() -> None:
    number = goal_model("builtin_interfaces.msg:Time", {"sec": {"minimum": -1.0, "maximum": 3.0}})
    schema = number.schema["properties"]["sec"]
    assert (repr(schema["minimum"]), repr(schema["maximum"])) == ("-1", "3")


def test_limits_within_arrays() -> None:
    path = goal_model(
        "nav_msgs.msg:Path",
        {
            "poses": {"max_items": 2},
            "poses[].pose.position.x": {"minimum": 1.0, "maximum": 2.0},
            "poses.header.frame_id": {"const": "map"},
        },
    )
    schema = path.schema
    assert schema["properties"]["poses"]["maxItems"] == 2
    good = {"pose": {"position": {"x": 1.5}}}
    fields, problems = path.check({"poses": [good, good]})
    assert problems == []
    assert fields["poses"][1]["header"] == {"frame_id": "map"}
    for poses, part in (
        ([good] * 3, "poses: has 3 elements, but must have at most 2"),
        ([good, {"pose": {"position": {"x": 3}}}], "poses[1].pose.position.x: 3 is outside of"),
        ([good, {}], "poses[1].pose.position.x: must be given"),
        ([None], "poses[0]: null is not allowed"),
        ({}, "poses: an object was given; this must be an array"),
    ):
        assert part in path.check({"poses": poses})[1][0]
    fixed = goal_model("test_msgs.msg:Arrays", {"basic_types_values.int8_value": {"default": 4}})
    fields, problems = fixed.check({})
    assert problems == []
    assert fields["basic_types_values"] == [{"int8_value": 4}] * 3
    numbers = goal_model("test_msgs.msg:Arrays", {"int32_values": {"minimum": 1}})
    assert numbers.check({})[1] == ["int32_values: must be given"]
    assert "int32_values[2]: 0 is outside" in numbers.check({"int32_values": [1, 1, 0]})[1][0]


def basic() -> GoalModel:
    return goal_model(
        "test_msgs.action:NestedMessage.Goal",
        {
            "nested_field.float64_value": {"minimum": -1.0, "maximum": 1.0},
            "nested_field.float32_value": {"minimum": -0.1, "maximum": 0.1},
            "nested_field.int32_value": {"enum": [1, 2], "default": 1},
        },
    )


@pytest.mark.parametrize(
    ("name", "value", "part"),
    [
        ("float64_value", math.nan, "must be a number, and finite"),
        ("float64_value", math.inf, "finite"),
        ("float64_value", 10**400, "is outside of -1 to 1"),
        ("float64_value", 1.0000000000000002, "is outside"),
        ("float64_value", True, "true must be a number"),
        ("float64_value", "1", "'1' must be a number"),
        ("float64_value", None, "null is not allowed"),
        ("float64_value", [1], "must be a number"),
        ("float32_value", 0.10001, "is outside of -0.1 to 0.1"),
        ("int8_value", 128, "is outside of -128 to 127"),
        ("int8_value", 1.5, "must be a whole number"),
        ("int8_value", 1e300, "is outside"),
        ("int8_value", math.inf, "finite"),
        ("int8_value", False, "must be a whole number"),
        ("uint64_value", 2**64, "is outside"),
        ("uint64_value", -1, "is outside"),
        ("int32_value", 3, "must be one of 1, 2"),
        ("bool_value", 1, "must be true or false"),
        ("byte_value", 256, "is outside of 0 to 255"),
        ("nope", 1, "there is no field 'nope'"),
        ("flaot64_value", 1, "did you mean 'float64_value'?"),
    ],
)
@pytest.mark.every
def test_values_outside_of_limits(name: str, value: Any, part: str) -> None:
    _, problems = basic().check({"nested_field": {name: value}})
    assert len(problems) == 1
    assert part in problems[0]
    assert len(problems[0]) < 700


@pytest.mark.parametrize(
    ("name", "value", "told"),
    [
        ("string_value", "a\0b", r"'a\x00b' holds a NUL character, which ROS cannot send"),
        (
            "string_value",
            "a\ud800",
            r"'a\ud800' holds half a character (a lone surrogate) at index 1",
        ),
        (
            "bounded_string_value",
            "ü" * 12,
            "'üüüüüüüüüüüü' has 24 bytes of UTF-8, but at most 22 are allowed",
        ),
        ("bounded_string_value", "ü" * 11, None),
        ("string_value", 1, "1 must be a string"),
        ("string_value", "abcde", "'abcde' has 5 bytes of UTF-8, but at most 4 are allowed"),
        ("string_value", "üüü", "'üüü' has 6 bytes of UTF-8, but at most 4 are allowed"),
        ("string_value", "abcd", None),
        ("string_value_default1", "c", "'c' must be one of 'a', 'b'"),
    ],
)
@pytest.mark.every
def test_strings(name: str, value: Any, told: str | None) -> None:
    of_two = {"enum": ["a", "b"], "default": "a"}
    strings = goal_model(
        "test_msgs.msg:Strings",
        {"string_value": {"max_length": 4}, "string_value_default1": of_two},
    )
    assert strings.check({name: value})[1] == ([] if told is None else [f"{name}: {told}"])


def test_wide_strings_are_counted_in_16_bit_units() -> None:
    wide = goal_model("test_msgs.msg:WStrings", {"wstring_value": {"max_length": 4}})
    for value in ("\U0001f600" * 2, "a\0b"):
        assert wide.check({"wstring_value": value}) == ({"wstring_value": value}, [])
    assert wide.check({"wstring_value": "\U0001f600" * 2 + "a"})[1] == [
        "wstring_value: '\U0001f600\U0001f600a' has 5 16-bit units, but at most 4 are allowed"
    ]


def test_the_schema_of_a_string_says_what_its_check_refuses() -> None:
    narrow = goal_model("test_msgs.msg:Strings", {"string_value": {"max_length": 4}}).schema
    common = {"type": "string", "maxLength": 4, "default": ""}
    assert narrow["properties"]["string_value"] == {
        **common,
        "pattern": r"^[^\u0000]*$",
        "description": "At most 4 bytes of UTF-8.",
    }
    wide = goal_model("test_msgs.msg:WStrings", {"wstring_value": {"max_length": 4}}).schema
    assert wide["properties"]["wstring_value"] == {
        **common,
        "description": "At most 4 16-bit units.",
    }


@pytest.mark.parametrize(
    ("path", "limits", "values", "told"),
    [
        ("BoundedSequences.bool_values", {}, [True] * 3, None),
        ("BoundedSequences.bool_values", {}, [True] * 4, "has 4 elements, but must have at most 3"),
        (
            "BoundedSequences.bool_values",
            {"max_items": 1},
            [True] * 2,
            "has 2 elements, but must have at most 1",
        ),
        (
            "UnboundedSequences.bool_values",
            {"max_items": 0},
            [True],
            "has 1 elements, but must have at most 0",
        ),
        ("Arrays.int32_values", {}, (1, 2, 3), None),
        ("Arrays.int32_values", {}, [1, 2], "has 2 elements, but must have exactly 3"),
        ("Arrays.int32_values", {}, [1] * 4, "has 4 elements, but must have exactly 3"),
        ("Arrays.int32_values", {}, {"0": 1}, "an object was given; this must be an array"),
    ],
)
@pytest.mark.every
def test_the_length_of_an_array(path: str, limits: Any, values: Any, told: str | None) -> None:
    name, _, field = path.partition(".")
    array = goal_model(f"test_msgs.msg:{name}", {field: limits})
    sent, problems = array.check({field: values})
    assert problems == ([] if told is None else [f"{field}: {told}"])
    assert sent == ({field: list(values)} if told is None else {})


def test_numbers_are_sent_within_limits_also_after_rounding() -> None:
    for value in (0.1, -0.1, 0.09999999999, 1e-46, -1e-46, 0.0):
        fields, problems = basic().check({"nested_field": {"float32_value": value}})
        assert problems == []
        sent = fields["nested_field"]["float32_value"]
        assert -0.1 <= sent <= 0.1
        assert struct.unpack("f", struct.pack("f", sent))[0] == sent
        assert sent == pytest.approx(value, abs=1e-8)
    tiny = goal_model(
        "test_msgs.msg:BasicTypes", {"float32_value": {"minimum": 1e-46, "maximum": 1.0}}
    )
    assert tiny.check({"float32_value": 1e-46})[0]["float32_value"] > 0
    # The limits themselves are within, also as whole numbers, and are sent as they are.
    exact = goal_model(
        "test_msgs.msg:BasicTypes", {"float32_value": {"minimum": -1.0, "maximum": 0.5}}
    )
    for edge in (-1, -1.0, 0.5):
        assert exact.check({"float32_value": edge}) == ({"float32_value": edge}, [])
    for whole in (-1, 1):
        assert basic().check({"nested_field": {"float64_value": whole}})[1] == []
    # As a float, this whole number is the limit.
    large = goal_model("test_msgs.msg:BasicTypes", {"float64_value": {"maximum": 2.0**53}})
    assert "is outside" in large.check({"float64_value": 2**53 + 1})[1][0]


def deep(levels: int) -> Any:
    found: Any = 1
    for _ in range(levels):
        found = {"nested_field": found}
    return found


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        (deep(10_000), "nested too deeply"),
        ({"a": [[0] * 1000] * 1000}, "too large"),
        ({"a": "x" * 10_000_000}, "too large"),
        ({"x" * 10_000_000: 1}, "too large"),
        ({str(i): i for i in range(200_000)}, "too large"),
        ({1: 2}, "the name 1 must be a string"),
        ({"a": {1, 2}}, "which JSON does not have"),
        ({"a": b"x"}, "which JSON does not have"),
        ({"a": to_plain}, "a function, which JSON does not have"),
    ],
)
@pytest.mark.every
def test_what_is_too_deep_or_too_large_is_refused_at_once(arguments: Any, part: str) -> None:
    began = time.process_time()
    problem = check_size(arguments)
    assert time.process_time() - began < 1.0
    assert problem is not None
    assert part in problem
    assert len(problem) < 300


@pytest.mark.parametrize("name", ["y" * 5000, "int32_val"])
def test_problems_are_few_and_short(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    compared = []

    def similar(word: str, known: Any) -> list[str]:
        compared.append(word)
        return similar_names(word, known)

    monkeypatch.setattr("actionkit.agents._arguments.problems.similar_names", similar)
    many = {f"{name}{i}": i for i in range(49_000 if len(name) < 10 else 100)}
    _, problems = basic().check(many)
    assert len(problems) == 10
    assert len("".join(problems)) < 5000
    # A name takes some 0.1 ms, a long one far more, and nothing else is done meanwhile.
    assert len(compared) <= (10 if len(name) < 10 else 0)


def test_the_values_of_a_boolean_are_limited_as_any_others() -> None:
    only = goal_model("test_msgs.msg:BasicTypes", {"bool_value": {"enum": [False]}})
    assert only.check({"bool_value": False})[1] == []
    assert only.check({"bool_value": True})[1] == ["bool_value: true must be one of false"]
    needed = goal_model("test_msgs.msg:BasicTypes", {"bool_value": {"enum": [True]}})
    assert needed.check({})[1] == ["bool_value: must be given"]
    each = goal_model("test_msgs.msg:UnboundedSequences", {"bool_values": {"enum": [True]}})
    assert each.check({"bool_values": [True, False]})[1] != []

"""Thousands of sets of arguments: none beyond the limits reaches a server."""

from __future__ import annotations

import asyncio
import json
import math
import random
from collections.abc import Callable
from typing import Any

from actionkit._messages.convert import from_plain
from actionkit.agents import Toolbox
from actionkit.agents._tool_calls.goal_call import _goal, _Refused
from tests.hunting import many

COUNT = many(10_000)
SERVER = """
import json, sys, threading, rclpy
from rclpy.action import ActionServer
from test_msgs.action import NestedMessage
from actionkit._messages.convert import to_plain
rclpy.init()
node = rclpy.create_node("journal")
def accept(request):
    print(json.dumps(to_plain(request)), flush=True)
    return rclpy.action.GoalResponse.ACCEPT
def execute(handle):
    handle.succeed()
    return NestedMessage.Result()
server = ActionServer(node, NestedMessage, "drive", execute, goal_callback=accept)
print("ready", flush=True)
rclpy.spin(node)
"""
LIMITS: dict[str, Any] = {
    "nested_field.float64_value": {"minimum": -1.5, "maximum": 2.5},
    "nested_field.float32_value": {"minimum": 0.1, "maximum": 0.3},
    "nested_field.int8_value": {"minimum": -3, "maximum": 4},
    "nested_field.uint64_value": {"maximum": 2**63},
    "nested_field.int32_value": {"enum": [7, 9], "default": 7},
    "nested_field.uint16_value": {"const": 42},
    "nested_field.int64_value": {"expose": False},
    "nested_different_pkg": {"expose": False},
}
NUMBERS: list[Any] = [
    *(0, 1, -1, 2.5, 2.5000000000000004, -1.5, 0.1, 0.3, 0.30000001, 0.2, 7, 9, 42, 4, 5, -3, -4),
    *(1.0, 7.0, 1e-46, 1e300, 2**63, 2**63 + 1, 2**64, -(2**63), 10**400, 3.5e38, 127, 128),
    *(math.nan, math.inf, -math.inf, True, False, None, "1", "", "NaN", [], [1], {}, {"a": 1}),
]
NAMES = [
    *("float64_value", "float32_value", "int8_value", "uint64_value", "int32_value"),
    *("bool_value", "uint8_value", "byte_value", "uint16_value", "int64_value", "nope", ""),
]


def in_limits(goal: Any) -> bool:
    """Whether a goal that a server got is within the limits; knows nothing of the code."""
    basic = goal["nested_field"]
    return (
        -1.5 <= basic["float64_value"] <= 2.5
        and 0.1 <= basic["float32_value"] <= 0.3
        and -3 <= basic["int8_value"] <= 4
        and 0 <= basic["uint64_value"] <= 2**63
        and basic["int32_value"] in (7, 9)
        and basic["uint16_value"] == 42
        and basic["int64_value"] == 0
        and goal["nested_different_pkg"] == {"sec": 0, "nanosec": 0}
    )


def argument_set(chance: random.Random) -> Any:
    """Return arguments, most of which are wrong somewhere, and some nowhere."""
    kind = chance.random()
    if kind < 0.05:
        return chance.choice([None, [], "x", {"nested_field": None}, {"": {}}, {"nested_field": 1}])
    if kind < 0.35:  # mostly right
        basic: dict[str, Any] = {"float32_value": chance.uniform(0.1, 0.3)}
        basic["float64_value"] = chance.choice([0, 1.0, 2.5, -1.5, chance.uniform(-1.6, 2.6)])
        if chance.random() < 0.5:
            basic["int8_value"] = chance.randint(-4, 5)
    else:
        names = chance.sample(NAMES, chance.randint(0, 4))
        basic = {name: chance.choice(NUMBERS) for name in names}
        if chance.random() < 0.7:
            basic["float32_value"] = chance.choice([0.1, 0.2, 0.3])
    arguments: dict[str, Any] = {"nested_field": basic}
    if chance.random() < 0.1:
        arguments["nested_different_pkg"] = {"sec": chance.choice(NUMBERS)}
    return arguments


def test_thousands_of_argument_sets(make_toolbox: Callable[..., Toolbox], run_script: Any) -> None:
    seed = random.randrange(2**32)
    chance = random.Random(seed)
    sets = [argument_set(chance) for _ in range(COUNT)]
    tool = {
        "action": "drive",
        "type": "test_msgs/action/NestedMessage",
        "expose": "all",
        "fields": LIMITS,
        "concurrent": 8,
        "timeout": 60.0,
    }
    toolbox = make_toolbox({"drive": tool})
    script = run_script(SERVER)
    assert script.line() == "ready"

    async def main() -> tuple[int, int]:
        sent = refused = 0
        turns = asyncio.Semaphore(8)

        async def one(arguments: Any) -> None:
            nonlocal sent, refused
            async with turns:
                result = (await toolbox.call("drive", arguments)).value
            if result["status"] == "succeeded":
                sent += 1
            else:
                assert result["error"]["type"] == "invalid_arguments", (seed, arguments, result)
                assert len(json.dumps(result)) < 5000
                refused += 1

        async with toolbox:
            config = toolbox._actions["drive"]
            right = [s for s in sets if isinstance(s, dict) and goal_of(config, s) is not None]
            # Most of what is right need not be sent: a hundred show that the way is open.
            skipped = {id(one) for one in right[100:]}
            for arguments in (s for s in right[100:]):
                assert in_limits(plain(_goal(config, arguments))), (seed, arguments)
            await asyncio.gather(*(one(s) for s in sets if id(s) not in skipped))
            assert len(right) > COUNT / 20, seed
            assert refused > COUNT / 2, seed
        return sent, refused

    sent, _ = asyncio.run(main())
    script.process.kill()  # a signal can leave a program of rclpy's alone hanging (R10)
    _, out, _ = script.finish(30)
    goals = [json.loads(line) for line in out.splitlines()]
    assert [goal for goal in goals if not in_limits(goal)] == [], seed
    assert len(goals) == sent >= 100, seed


def goal_of(config: Any, arguments: Any) -> Any:
    """Return the goal that would be sent, or `None`."""
    try:
        return _goal(config, arguments)
    except _Refused:
        return None


def plain(goal: Any) -> Any:
    from actionkit._messages.convert import to_plain

    return to_plain(from_plain(type(goal), goal))

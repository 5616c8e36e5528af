"""An agent: it perceives, plans, acts, and adjusts its plan to what became of its goals.

A scripted model stands in for a language model, so this needs no key and no network. To put a
real one in its place, give it `toolbox.openai_tools()` or `toolbox.anthropic_tools()`, and have it
choose the steps that `scripted_model` yields here. What it may do is in `robot.toml`, and the
toolbox holds it to that, whatever it asks for.
"""

from __future__ import annotations

import asyncio
import json
import sys
from collections.abc import Callable, Generator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from actionkit.agents import Toolbox

ROBOT = Path(__file__).with_name("robot.toml")


@dataclass(frozen=True)
class Step:
    """What the model wants next."""

    thought: str
    tool: str
    arguments: Mapping[str, Any]


Model = Generator[Step, Mapping[str, Any], str]
"""Yields steps, is sent what became of each, and returns its last word."""


def metres(distance: float, **more: float) -> dict[str, Any]:
    return {"nested_field": {"float64_value": distance, **more}}


def scripted_model() -> Model:
    """Bring parcels to the other side until somebody stops it."""
    battery = yield Step("Is there enough power?", "battery", {})
    if battery["error"] or battery["message"]["voltage"] < 11.0:
        return "I stay where I am: the battery is low, or not known."
    there = yield Step("The left aisle is the shorter one.", "left_aisle", metres(4.0))
    if there["status"] != "succeeded":
        thought = f"It ended as {there['status']}; I take the right aisle, and fast."
        there = yield Step(thought, "right_aisle", metres(2.0, float32_value=3.0))
    if there["status"] == "refused":
        thought = "Too fast, so within the limit."
        there = yield Step(thought, "right_aisle", metres(2.0, float32_value=1.0))
    while there["status"] == "succeeded":
        there = yield Step("I am there. Now the next parcel.", "right_aisle", metres(20.0))
    yield Step("Is anything still running?", "goals", {})
    there = yield Step("May I go on?", "right_aisle", metres(1.0))
    return f"I stop here: {there['error']['message'] if there['error'] else 'all is done'}"


async def run(
    toolbox: Toolbox, model: Model, say: Callable[[str], object] = print
) -> list[Mapping[str, Any]]:
    """Have the model choose steps, and the robot carry them out, until the model has enough."""
    results: list[Mapping[str, Any]] = []
    try:
        step = next(model)
        while True:
            say(f"model: {step.thought}\n       {step.tool}({json.dumps(step.arguments)})")
            result = await toolbox.call(step.tool, step.arguments)
            say(f"robot: {in_short(result.value)}")
            results.append(result.value)
            step = model.send(result.value)
    except StopIteration as end:
        say(f"model: {end.value}")
    return results


def in_short(value: Mapping[str, Any]) -> str:
    """Return what a person following the conversation wants to read of a result."""
    if value["error"] is not None:
        return f"{value['status']}: {value['error']['message']}"
    if "goals" in value:
        told = [f"{goal['tool']} {goal['status']}" for goal in value["goals"]]
        running = sum(goal["may_still_run"] for goal in value["goals"])
        return f"{', '.join(told)}; {running} may still run"
    if "message" in value:
        return f"{value['status']}: {value['message'].get('voltage')} V"
    return f"{value['status']}, {value['feedback_count']} feedbacks"


async def main(path: str | Path = ROBOT) -> None:
    async with Toolbox.from_file(path) as toolbox:
        await run(toolbox, scripted_model())


if __name__ == "__main__":
    asyncio.run(main(*sys.argv[1:]))

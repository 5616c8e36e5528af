"""The tools of a toolbox as data: for models, and in the formats of their APIs."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from actionkit._model.printable import full_stop
from actionkit.agents._answers.results import ActionValue, GoalsValue, TopicValue
from actionkit.agents._configuration.config import ActionConfig, Config, TopicConfig
from actionkit.agents._values import DIALECT, GOALS, Tool

_NO_INPUT = {"$schema": DIALECT, "type": "object", "properties": {}, "additionalProperties": False}
_GOAL_ID = {"goal_id": {"type": "string", "description": "Only this one."}}

_GOALS_TEXT = (
    "Tells which goals this toolbox has sent, what happened to each, and which may still be"
    " running; also those that were cancelled. Also tells of goals that other programs have sent to"
    " the same actions and that run now."
)


def make_tools(config: Config) -> tuple[Tool, ...]:
    """Return all tools of a configuration."""
    from actionkit.agents._answers.output import output_schema  # slow

    actions = [
        Tool(
            name=tool.name,
            description=_described(tool),
            input_schema=tool.fields.schema,
            output_schema=output_schema(
                ActionValue, result=tool.cls.Result, feedback=tool.cls.Feedback
            ),
            confirm=tool.confirm == "always",
            kind="action",
        )
        for tool in config.tools.values()
    ]
    topics = [
        Tool(
            name=topic.name,
            description=_about(topic),
            input_schema=_NO_INPUT,
            output_schema=output_schema(TopicValue, message=topic.cls),
            confirm=False,
            kind="topic",
        )
        for topic in config.topics.values()
    ]
    goals_input = {**_NO_INPUT, "properties": _GOAL_ID}
    goals = Tool(GOALS, _GOALS_TEXT, goals_input, output_schema(GoalsValue), False, "goals")
    return (*actions, *topics, goals)


def _about(topic: TopicConfig) -> str:
    reads = f"Reads the latest message of the topic {topic.topic} ({topic.ros_type})."
    return topic.description or reads


def _described(tool: ActionConfig) -> str:
    """Return what a model is told of a tool: what it does, and under which conditions."""
    always = tool.confirm == "always"
    asked = "A human is asked to approve each goal" if always else "No human is asked first"
    about = tool.description or f"Sends a goal to the action {tool.action} ({tool.ros_type})."
    many = "one goal" if tool.concurrent == 1 else f"{tool.concurrent} goals"
    return (
        f"{full_stop(about)} {asked}. A goal may take {tool.timeout:g} s, then it is"
        f" cancelled. At most {many} at a time."
    )


def in_format(tools: Iterable[Tool], schema: str) -> list[dict[str, Any]]:
    """Return tools as the APIs of models take them; they differ in the key of the schema."""
    return [
        {"name": tool.name, "description": tool.description, schema: dict(tool.input_schema)}
        for tool in tools
    ]

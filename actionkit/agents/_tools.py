"""The tools of a toolbox as data: for models, and in the formats of their APIs."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from actionkit._model.printable import full_stop
from actionkit.agents._config import GOALS, ActionConfig, Config
from actionkit.agents._output import (
    GOALS_INPUT,
    NO_INPUT,
    action_output,
    goals_output,
    topic_output,
)
from actionkit.agents._values import Tool

_GOALS_TEXT = (
    "Tells which goals this toolbox has sent, what happened to each, and which may still be"
    " running; also those that were cancelled. Also tells of goals that other programs have sent to"
    " the same actions and that run now."
)


def make_tools(config: Config) -> tuple[Tool, ...]:
    """Return all tools of a configuration."""
    actions = [
        Tool(
            name=tool.name,
            description=_described(tool),
            input_schema=tool.model.schema,
            output_schema=action_output(tool),
            confirm=tool.confirm,
            kind="action",
        )
        for tool in config.actions
    ]
    topics = [
        Tool(topic.name, topic.description, NO_INPUT, topic_output(topic), False, "topic")
        for topic in config.topics
    ]
    goals = Tool(GOALS, _GOALS_TEXT, GOALS_INPUT, goals_output(), False, "goals")
    return (*actions, *topics, goals)


def _described(tool: ActionConfig) -> str:
    """Return what a model is told of a tool: what it does, and under which conditions."""
    asked = "A human is asked to approve each goal" if tool.confirm else "No human is asked first"
    many = "one goal" if tool.concurrent == 1 else f"{tool.concurrent} goals"
    return (
        f"{full_stop(tool.description)} {asked}. A goal may take {tool.timeout:g} s, then it is"
        f" cancelled. At most {many} at a time."
    )


def openai_format(tools: Iterable[Tool]) -> list[dict[str, Any]]:
    """Return tools as OpenAI's API takes them."""
    return [
        {
            "type": "function",
            "function": {
                "name": tool.name,
                "description": tool.description,
                "parameters": dict(tool.input_schema),
            },
        }
        for tool in tools
    ]


def anthropic_format(tools: Iterable[Tool]) -> list[dict[str, Any]]:
    """Return tools as Anthropic's API takes them."""
    return [
        {
            "name": tool.name,
            "description": tool.description,
            "input_schema": dict(tool.input_schema),
        }
        for tool in tools
    ]

"""Calls of the tools that only read: topics, and what happened to goals."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Mapping
from typing import Any

from actionkit._internal_api import in_thread
from actionkit._model.field_errors import shown
from actionkit.agents._clients import Clients
from actionkit.agents._config import ActionConfig, TopicConfig
from actionkit.agents._goals import Goals
from actionkit.agents._results import ErrorValue, GoalsValue, ListedGoal, tool_result
from actionkit.agents._ros import GoalThere
from actionkit.agents._topics import WAIT, topic_failure, topic_result
from actionkit.agents._values import ToolResult

_log = logging.getLogger("actionkit")


async def read_topic(
    clients: Clients, topic: TopicConfig, arguments: Mapping[str, Any]
) -> ToolResult:
    """Read the latest message. Cancelling the awaiting task ends the subscription."""
    if arguments:
        text = f"{topic.name} takes no arguments"
        return topic_failure(topic, "refused", "invalid_arguments", text)
    try:
        future = await in_thread(
            lambda: clients.node.read(topic.topic, topic.ros_type, topic.cls, WAIT, topic.max_age)
        )
        reading = await asyncio.wrap_future(future)
        return await in_thread(lambda: topic_result(topic, reading))
    except Exception as error:  # noqa: BLE001  also what the middleware raises
        if clients.closed:
            return topic_failure(topic, "refused", "closed", "the toolbox was closed")
        _log.warning("%s: %s", topic.name, error, exc_info=error)
        text = f"{topic.topic} cannot be read; the toolbox's log says why"
        return topic_failure(topic, "failed", "failed", text)


def goals_result(
    goals: Goals, others: list[tuple[ActionConfig, GoalThere]], arguments: Mapping[str, Any]
) -> ToolResult:
    """Return what happened to the goals, or to the one asked for; goals of others come last."""
    goal_id = arguments.get("goal_id")
    unknown = [name for name in arguments if name != "goal_id"]
    problem = ""
    found: list[ListedGoal] = []
    if unknown:
        problem = f"there is no argument {shown(unknown[0])}; there is goal_id"
    elif goal_id is not None and not isinstance(goal_id, str):
        problem = f"goal_id {shown(goal_id)} must be a string"
    else:
        found += [ListedGoal(**one) for one in goal_reports(goals, goal_id)]
        found += [_of_other(*one) for one in others if goal_id in (None, one[1].goal_id)]
        if goal_id is not None and not found:
            problem = f"no goal {shown(goal_id)} is known here; without goal_id all are told of"
    if problem:
        error = ErrorValue("invalid_arguments", problem, False, "Change the arguments.")
        return tool_result(GoalsValue(status="refused", error=error))
    return tool_result(GoalsValue(goals=found))


def _of_other(tool: ActionConfig, goal: GoalThere) -> ListedGoal:
    """Return what is known of a goal that another program has sent."""
    status = "canceling" if goal.state == "CANCELING" else "running"
    told = (goal.goal_id, tool.name, status, goal.state)
    return ListedGoal(*told, may_still_run=True, elapsed=goal.age, sent_here=False)


def goal_reports(goals: Goals, goal_id: str | None) -> tuple[dict[str, Any], ...]:
    """Return what is known of the goals, the latest first."""
    records = goals.latest()
    return tuple(one.report() for one in records if goal_id is None or goal_id in one.ids)

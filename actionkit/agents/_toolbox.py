"""The toolbox: tools by name, called with checked arguments and within limits."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from os import PathLike
from types import TracebackType
from typing import Any

from typing_extensions import Self

from actionkit._internal_api import in_thread
from actionkit._model.environment.domain import environment_domain
from actionkit._model.field_errors import shown
from actionkit.agents._answers.results import refusal
from actionkit.agents._configuration.config import Config, check_domain, read_config, read_file
from actionkit.agents._tool_calls.clients import Clients
from actionkit.agents._tool_calls.goal_call import GoalCalls
from actionkit.agents._tool_calls.goals import Goals, goals_result
from actionkit.agents._tool_calls.topics import read_topic
from actionkit.agents._tools import in_format, make_tools
from actionkit.agents._values import GOALS, Approve, Json, OnProgress, Tool, ToolResult

_CANCEL_WAIT = 3.0
"""Seconds; `timeouts.cancel`, and what it takes to tell of it."""
_CHANGE = "Nothing was sent; call one of the tools with arguments that its schema describes."


class Toolbox:
    """Actions and topics of a robot, as tools for a language model.

        async with Toolbox.from_file("robot.toml") as toolbox:
            result = await toolbox.call("navigate", {"pose": {"position": {"x": 1.0}}})
            print(result.value["status"], result.value["may_still_run"])

    You can call only what its configuration lists, and only within the limits given there. It
    belongs to the first event loop that uses it.
    """

    def __init__(self, config: Config, domain_id: int | None) -> None:
        self._tools = make_tools(config)
        self._actions = config.tools
        self._topics = config.topics
        self._domain_id = config.domain_id if domain_id is None else domain_id
        self._goals = Goals()
        self._clients = Clients(self._domain_id, self._goals)
        self._calls = GoalCalls(self._clients, self._goals)

    @classmethod
    def from_file(cls, path: str | PathLike[str], *, domain_id: int | None = None) -> Self:
        """Read a configuration file, and check all of it.

        Args:
            path: A TOML file.
            domain_id: The ROS domain. It overrides the file and the environment.

        Raises:
            ConfigError: Something in it is wrong; every problem is listed with its place.
            OSError: The file cannot be read.
        """
        return cls(read_file(path), check_domain(domain_id))

    @classmethod
    def from_config(cls, config: Mapping[str, Any], *, domain_id: int | None = None) -> Self:
        """Take a configuration from Python, with the same structure as the file.

        Args:
            config: Nested mappings.
            domain_id: The ROS domain. It overrides the configuration and the environment.

        Raises:
            ConfigError: Something in it is wrong; every problem is listed with its place.
        """
        return cls(read_config(config), check_domain(domain_id))

    @property
    def tools(self) -> tuple[Tool, ...]:
        """All tools: for actions, for topics, and `goals`."""
        return self._tools

    @property
    def domain_id(self) -> int:
        """The ROS domain."""
        return environment_domain() if self._domain_id is None else self._domain_id

    def action_of(self, tool: str) -> str:
        """Return the name of the action that a tool sends goals to.

        Raises:
            KeyError: It is not a tool of an action.
        """
        return self._actions[tool].action

    async def call(
        self,
        name: str,
        arguments: Mapping[str, Any] | None = None,
        *,
        on_progress: OnProgress | None = None,
        approve: Approve | None = None,
    ) -> ToolResult:
        """Call a tool. If something goes wrong, the result says so.

        If you cancel the task that awaits this, the goal is cancelled. The task waits at most 4
        seconds for the server's confirmation. `goals` tells what happened to it.

        Args:
            name: The tool.
            arguments: A JSON object, checked against the tool's limits before anything is sent.
            on_progress: Called for feedback, and every 5 seconds while nothing changes, also while
                a human is asked.
            approve: Asks a human, for tools that need it. Without it, these tools are refused. If
                it raises, the caller gets the error, and nothing is sent.

        Raises:
            asyncio.CancelledError: The awaiting task was cancelled.
        """
        if arguments is None:
            arguments = {}
        if not isinstance(name, str) or not isinstance(arguments, Mapping):
            text = "a tool's name must be a string, and its arguments an object"
            return refusal(shown(name), "invalid_arguments", text, retry=False, advice=_CHANGE)
        if name in self._actions:
            return await self._calls.call(self._actions[name], arguments, on_progress, approve)
        if name in self._topics:
            return await read_topic(self._clients, self._topics[name], arguments)
        if name == GOALS:
            others = await self._calls.others(self._actions.values())
            return goals_result(self._goals, others, arguments)
        known = ", ".join(tool.name for tool in self._tools)
        text = f"there is no tool {shown(name)}; the tools are: {known}"
        return refusal(shown(name), "unknown_tool", text, retry=False, advice=_CHANGE)

    async def cancel_all(self) -> tuple[Json, ...]:
        """Cancel every goal in flight, and every call that waits to send one.

        Returns:
            What happened to each goal, in the form of `goals()`. It returns when the servers have
            confirmed it, or when 3 seconds are over.
        """
        records = self._calls.cancel_all("all goals were cancelled")
        ends = [record.over(_CANCEL_WAIT) for record in records]
        await asyncio.gather(*ends)
        return tuple(record.report() for record in records)

    def goals(self, goal_id: str | None = None) -> tuple[Json, ...]:
        """What happened to the goals of this toolbox, the latest first, also those in flight.

        Args:
            goal_id: Return only this goal.
        """
        return self._goals.reports(goal_id)

    def openai_tools(self) -> list[dict[str, Any]]:
        """The tools in the format of OpenAI's API, for its `tools=`."""
        functions = in_format(self._tools, "parameters")
        return [{"type": "function", "function": function} for function in functions]

    def anthropic_tools(self) -> list[dict[str, Any]]:
        """The tools in the format of Anthropic's API, for its `tools=`."""
        return in_format(self._tools, "input_schema")

    def close(self) -> None:
        """Cancel the goals in flight, and free everything. Blocks. Any thread may call it."""
        self._clients.close()

    async def aclose(self) -> None:
        """Do the same as `close` without blocking the event loop."""
        await in_thread(self.close)

    async def __aenter__(self) -> Self:
        await self._calls.start()
        return self

    async def __aexit__(
        self,
        exc_type: type[BaseException] | None,
        exc: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        await self.aclose()

"""The toolbox: tools by name, called with checked arguments and within limits."""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike
from types import TracebackType
from typing import Any

from typing_extensions import Self

from actionkit.agents._values import Approve, Json, OnProgress, Tool, ToolResult


class Toolbox:
    """Actions and topics of a robot, as tools for a language model.

        async with Toolbox.from_file("robot.toml") as toolbox:
            result = await toolbox.call("navigate", {"pose": {"position": {"x": 1.0}}})
            print(result.value["status"], result.value["may_still_run"])

    Only what its configuration lists can be called, and only within the limits given there. It
    belongs to the event loop that it is used in first.
    """

    @classmethod
    def from_file(cls, path: str | PathLike[str], *, domain_id: int | None = None) -> Self:
        """Read a configuration file, and check the whole of it.

        Args:
            path: A TOML file.
            domain_id: The ROS domain, in place of the file's and of the environment's.

        Raises:
            ConfigError: Something in it is wrong; every problem is listed with its place.
            OSError: The file cannot be read.
        """
        raise NotImplementedError

    @classmethod
    def from_config(cls, config: Mapping[str, Any], *, domain_id: int | None = None) -> Self:
        """Take a configuration from Python, in the form that the file has.

        Args:
            config: Nested mappings.
            domain_id: The ROS domain, in place of the configuration's and of the environment's.

        Raises:
            ConfigError: Something in it is wrong; every problem is listed with its place.
        """
        raise NotImplementedError

    @property
    def tools(self) -> tuple[Tool, ...]:
        """All tools: those of actions, those of topics, and `goals`."""
        raise NotImplementedError

    @property
    def domain_id(self) -> int:
        """The ROS domain."""
        raise NotImplementedError

    async def call(
        self,
        name: str,
        arguments: Mapping[str, Any],
        *,
        on_progress: OnProgress | None = None,
        approve: Approve | None = None,
    ) -> ToolResult:
        """Call a tool. What goes wrong is told in the result.

        Cancelling the task that awaits this cancels the goal, and waits for the server's
        confirmation, `timeouts.cancel` seconds at most; `goals` tells what became of it.

        Args:
            name: The tool.
            arguments: A JSON object, checked against the tool's limits before anything is sent.
            on_progress: Told of feedback, and every 5 seconds while nothing changes.
            approve: Asks a human, for tools that need it. Without it these are refused.

        Raises:
            TypeError: `name` is no str, or `arguments` is no mapping.
            asyncio.CancelledError: The awaiting task was cancelled.
        """
        raise NotImplementedError

    async def cancel_all(self) -> tuple[Json, ...]:
        """Cancel every goal in flight, and every call that waits to send one.

        Returns:
            What became of each, as `goals()` tells it, when the servers have confirmed it or
            `timeouts.cancel` seconds are over.
        """
        raise NotImplementedError

    def goals(self, goal_id: str | None = None) -> tuple[Json, ...]:
        """What became of the goals of this toolbox, the latest first; those in flight too.

        Args:
            goal_id: Only this one.
        """
        raise NotImplementedError

    def openai_tools(self) -> list[dict[str, Any]]:
        """The tools in the format of OpenAI's API: what its `tools=` takes."""
        raise NotImplementedError

    def anthropic_tools(self) -> list[dict[str, Any]]:
        """The tools in the format of Anthropic's API: what its `tools=` takes."""
        raise NotImplementedError

    def close(self) -> None:
        """Cancel the goals in flight, and free all that is held. Blocks; from any thread."""
        raise NotImplementedError

    async def aclose(self) -> None:
        """Do the same as `close` without blocking the event loop."""
        raise NotImplementedError

    async def __aenter__(self) -> Self:
        raise NotImplementedError

    async def __aexit__(
        self,
        exc_type: type[BaseException] | None,
        exc: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        await self.aclose()

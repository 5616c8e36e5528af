"""What a toolbox gives to its user: tools, results, progress, questions for a human."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

Json = Mapping[str, Any]
"""A JSON object, as plain dicts, lists, strings, numbers, booleans and None."""
DIALECT = "https://json-schema.org/draft/2020-12/schema"
"""The `$schema` of every schema of a tool."""
GOALS = "goals"
"""The tool that every toolbox has."""


class ConfigError(ValueError):
    """A toolbox's configuration is wrong. `str()` lists every problem with its place.

    Attributes:
        problems: One text for each problem, such as
            `robot.toml: tools.navigate.timeout: 'long' must be a number`.
    """

    def __init__(self, problems: tuple[str, ...]) -> None:
        super().__init__(problems)
        self.problems = problems

    def __str__(self) -> str:
        return "\n".join(self.problems)


@dataclass(frozen=True)
class Tool:
    """One tool, as a language model sees it.

    Attributes:
        name: The name for `Toolbox.call`.
        description: What it does, for the model.
        input_schema: JSON Schema (2020-12) of its arguments. `Toolbox.call` also checks what a
            schema cannot express: numbers that JSON Schema cannot tell apart, and all other limits.
        output_schema: JSON Schema (2020-12) of `ToolResult.value`.
        confirm: Whether a human approves each call.
        kind: `"action"` (moves something), `"topic"` (reads only) or `"goals"` (what
            happened to goals; reads only).
    """

    name: str
    description: str
    input_schema: Json
    output_schema: Json
    confirm: bool
    kind: Literal["action", "topic", "goals"]


@dataclass(frozen=True)
class Image:
    """A picture in a result.

    Attributes:
        mime_type: `"image/jpeg"` or `"image/png"`.
        data: The file's bytes.
    """

    mime_type: str
    data: bytes


@dataclass(frozen=True)
class ToolResult:
    """What a tool returned. Every call returns one. A failure is a result, too: it is not raised.

    Attributes:
        value: A JSON object that fits the tool's `output_schema`.
        is_error: Whether the tool did not do what it was asked to.
        images: Pictures that belong to the result.
    """

    value: Json
    is_error: bool
    images: tuple[Image, ...] = ()


@dataclass(frozen=True)
class Progress:
    """The progress of a call of an action's tool.

    Attributes:
        elapsed: Seconds since the goal was sent; before that, since a human was asked.
        feedback_count: How many feedback messages have come.
        message: One line for people: the state, and the latest feedback in short.
        percent: 0 to 100 if the feedback has such a field, else `None`.
    """

    elapsed: float
    feedback_count: int
    message: str
    percent: float | None


@dataclass(frozen=True)
class ApprovalRequest:
    """What a human is asked to approve.

    Attributes:
        tool: The tool's name.
        arguments: The whole goal that would be sent: what the model gave, defaults, constants.
        text: A question that can be shown as it is.
    """

    tool: str
    arguments: Json
    text: str


Approve = Callable[[ApprovalRequest], Awaitable[bool]]
"""Asks a human; returns whether they agree."""
OnProgress = Callable[[Progress], None] | Callable[[Progress], Awaitable[None]]
"""Is told of progress; a plain or a coroutine function, on the event loop of the call."""

"""Calls of the tools that read topics: the latest message, as a result."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from actionkit.agents._answers.images import ImageError, is_image, to_image
from actionkit.agents._answers.plain import plain_json
from actionkit.agents._answers.results import ErrorValue, TopicStatus, TopicValue, tool_result
from actionkit.agents._configuration.config import TopicConfig
from actionkit.agents._tool_calls.clients import Clients
from actionkit.agents._values import Image, ToolResult

if TYPE_CHECKING:
    from actionkit._ros.others_goals.topic import Reading

_WAIT = 5.0
"""Seconds for a message. A node that has just been made may need three to find publishers."""
_log = logging.getLogger("actionkit")


async def read_topic(
    clients: Clients, topic: TopicConfig, arguments: Mapping[str, Any]
) -> ToolResult:
    """Read the latest message. Cancelling the awaiting task ends the subscription."""
    if arguments:
        text = f"{topic.name} takes no arguments"
        return _failure(topic, "refused", "invalid_arguments", text)

    def read(domain_id: int | None, stopped: Callable[[], bool]) -> ToolResult:
        from actionkit._ros.others_goals.topic import StoppedError, latest

        name, kind, cls = topic.topic, topic.ros_type, topic.cls
        try:
            reading = latest(domain_id, name, kind, cls, _WAIT, topic.max_age, stopped)
        except StoppedError:  # nothing is wrong, so the log does not tell of it
            if clients.closed:
                return _closed(topic)
            text = f"the reading of {name} was stopped, as this program ends"
            return _failure(topic, "failed", "failed", text)
        return _result(topic, reading)

    try:
        return await clients.read(read)
    except Exception as error:  # noqa: BLE001  also what the middleware raises
        if clients.closed:
            return _closed(topic)
        _log.warning("%s: %s", topic.name, error, exc_info=error)
        text = f"{topic.topic} cannot be read; the toolbox's log says why"
        return _failure(topic, "failed", "failed", text)


def _closed(topic: TopicConfig) -> ToolResult:
    return _failure(topic, "refused", "closed", "the toolbox was closed")


def _failure(topic: TopicConfig, status: TopicStatus, kind: str, message: str) -> ToolResult:
    """Return the result of a reading that failed."""
    error = ErrorValue(kind, message, status != "refused", "Do without it, or try again later.")
    value = TopicValue(topic.name, status, topic.topic, topic.ros_type, error=error)
    return tool_result(value)


def _result(topic: TopicConfig, reading: Reading) -> ToolResult:
    """Return what was read. Takes a while for a large image."""
    if reading.message is None:
        return _failure(topic, "no_message", "no_message", _why_none(topic, reading))
    notes: list[str] = []
    images: tuple[Image, ...] = ()
    if is_image(topic.ros_type):
        plain = plain_json(reading.message, 0)
        plain.pop("data", None)
        try:
            image, text = to_image(reading.message, topic.max_size)
            images = (image,)
            notes.append(f"The image: {text}.")
        except ImageError as error:
            notes.append(f"The image cannot be shown: {error}.")
    else:
        plain = plain_json(reading.message, topic.max_size)
        if _is_cut(plain):
            notes.append("Some arrays or texts are cut; their ends say how much is missing.")
    age = None if reading.age is None else round(reading.age, 3)
    value = TopicValue(topic.name, "received", topic.topic, topic.ros_type, age, plain, notes)
    return tool_result(value, images)


def _why_none(topic: TopicConfig, reading: Reading) -> str:
    if reading.other_types and not reading.publishers:
        others = ", ".join(reading.other_types)
        return f"{topic.topic} is published as {others}, and not as {topic.ros_type}"
    if not reading.publishers:
        return f"nobody publishes {topic.topic}"
    young = "" if topic.max_age is None else f" of the last {topic.max_age:g} s"
    return f"no message{young} came on {topic.topic} within {_WAIT:g} s, though it has a publisher"


def _is_cut(value: Any) -> bool:
    if isinstance(value, str):
        return "… " in value and value.endswith((" more", " more characters"))
    if isinstance(value, dict):
        return any(map(_is_cut, value.values()))
    # Of an array, what was cut is told by its last element.
    return isinstance(value, list) and any(map(_is_cut, value))

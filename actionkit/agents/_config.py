"""The configuration of a toolbox: read as a whole, every problem told with its place."""

from __future__ import annotations

import importlib
import logging
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from os import PathLike, fspath
from typing import TYPE_CHECKING, Any

from actionkit._messages.by_name import interface_class
from actionkit._model.domain import LAST_DOMAIN
from actionkit._model.field_errors import shown
from actionkit._model.settings import MOST
from actionkit.agents._reader import Reader
from actionkit.agents._values import ConfigError

if TYPE_CHECKING:
    from actionkit.agents._goal_model import GoalModel

GOALS = "goals"
"""The tool that every toolbox has."""
_log = logging.getLogger("actionkit")
_NAME = re.compile(r"[A-Za-z0-9_-]{1,64}")
"""What the APIs of language models take as the name of a tool."""
_ROS_NAME = re.compile(r"/?[A-Za-z_]\w*(/[A-Za-z_]\w*)*", re.ASCII)
_TIMEOUT = 60.0
_RETRIES = 2
_MAX_SIZE = 768
_ACTION_KEYS = (
    "action",
    "type",
    "description",
    "timeout",
    "concurrent",
    "confirm",
    "retries",
    "expose",
    "fields",
)
_TOPIC_KEYS = ("topic", "type", "description", "max_age", "max_size")


@dataclass(frozen=True)
class ActionConfig:
    """A tool that sends goals.

    Attributes:
        name: Of the tool.
        action: The action's name.
        ros_type: Such as `nav2_msgs/action/NavigateToPose`.
        cls: The type's class.
        description: For the model.
        timeout: Seconds for everything.
        concurrent: The most goals at a time.
        confirm: Whether a human approves each.
        retries: How many more goals may be sent where one failed for a reason that may pass.
        model: Of the goal, with its limits.
        warnings: What is allowed, and may not be meant.
    """

    name: str
    action: str
    ros_type: str
    cls: Any
    description: str
    timeout: float
    concurrent: int
    confirm: bool
    retries: int
    model: GoalModel
    warnings: tuple[str, ...]


@dataclass(frozen=True)
class TopicConfig:
    """A tool that reads a topic.

    Attributes:
        name: Of the tool.
        topic: The topic's name.
        ros_type: Such as `sensor_msgs/msg/BatteryState`.
        cls: The type's class.
        description: For the model.
        max_age: Seconds; an older message counts as none. `None` takes any.
        max_size: Pixels of an image's longer side; of other messages, elements of an array.
    """

    name: str
    topic: str
    ros_type: str
    cls: Any
    description: str
    max_age: float | None
    max_size: int


@dataclass(frozen=True)
class Config:
    """A whole configuration.

    Attributes:
        domain_id: The ROS domain; `None` takes the environment's.
        actions: Its tools that send goals.
        topics: Those that read topics.
    """

    domain_id: int | None
    actions: tuple[ActionConfig, ...]
    topics: tuple[TopicConfig, ...]


def read_file(path: str | PathLike[str]) -> Config:
    """Read a TOML file.

    Raises:
        ConfigError: It is wrong.
        OSError: It cannot be read.
        ImportError: The extra `agents` is not installed.
    """
    try:
        toml: Any = importlib.import_module("tomllib" if sys.version_info >= (3, 11) else "tomli")
    except ImportError as error:
        raise ImportError(f"{error}; pip install tomli") from error
    with open(path, "rb") as file:
        content = file.read()
    source = fspath(path)
    try:
        config = toml.loads(content.decode())
    except (ValueError, RecursionError) as error:  # also numbers of thousands of digits
        raise ConfigError((f"{source}: this is no TOML: {error}",)) from error
    return read_config(config, source)


def read_config(config: object, source: str = "configuration") -> Config:
    """Read a configuration that is nested mappings.

    Raises:
        ConfigError: It is wrong.
        ImportError: The extra `agents` is not installed.
    """
    read = Reader(source)
    table = read.table("", config, ("domain_id", "tools", "topics"))
    domain_id = read.whole("domain_id", table.get("domain_id"), 0, LAST_DOMAIN)
    actions = [
        action
        for name, one in read.tables("tools", table.get("tools"))
        if (action := _action(read, name, one)) is not None
    ]
    topics = [
        topic
        for name, one in read.tables("topics", table.get("topics"))
        if (topic := _topic(read, name, one)) is not None
    ]
    for twice in {a.name for a in actions} & {t.name for t in topics}:
        read.add(f"topics.{twice}", f"there is a tool {twice!r} in [tools], too; rename one")
    types: dict[str, str] = {}
    for action in actions:
        known = types.setdefault(action.action, action.ros_type)
        if known != action.ros_type:
            read.add(f"tools.{action.name}.type", f"{action.action!r} has the type {known!r} above")
    if not read.problems and not actions and not topics:
        read.add("", "there are no tools; add a table [tools.NAME] or [topics.NAME]")
    read.raise_problems()
    for action in actions:
        for warning in action.warnings:
            _log.warning("%s: tools.%s: %s", source, action.name, warning)
    return Config(domain_id, tuple(actions), tuple(topics))


def check_domain(domain_id: object) -> int | None:
    """Return a domain that was given as an argument.

    Raises:
        ConfigError: It is none.
    """
    read = Reader("arguments")
    checked = read.whole("domain_id", domain_id, 0, LAST_DOMAIN)
    read.raise_problems()
    return checked


def _action(read: Reader, name: str, content: object) -> ActionConfig | None:
    place = f"tools.{name}"
    before = len(read.problems)
    _check_name(read, place, name)
    table = read.table(place, content, _ACTION_KEYS)
    action = read.text(f"{place}.action", table.get("action"), needed=True)
    _check_ros_name(read, f"{place}.action", action)
    ros_type = read.text(f"{place}.type", table.get("type"), needed=True)
    cls = _cls(read, f"{place}.type", ros_type, "action")
    description = read.text(f"{place}.description", table.get("description"))
    timeout = read.number(f"{place}.timeout", table.get("timeout", _TIMEOUT), 0.0, MOST)
    if timeout == 0:
        read.add(f"{place}.timeout", "must be above 0: with 0 nothing is ever sent")
    concurrent = read.whole(f"{place}.concurrent", table.get("concurrent", 1), 1, 1000)
    retries = read.whole(f"{place}.retries", table.get("retries", _RETRIES), 0, 1000)
    confirm = table.get("confirm", "never")
    if confirm not in ("never", "always"):
        read.add(f"{place}.confirm", f"{confirm!r} must be 'never' or 'always'")
    expose = table.get("expose")
    if expose not in (None, "listed", "all"):
        read.add(f"{place}.expose", f"{shown(expose)} must be 'listed' or 'all'")
    model = None
    if cls is not None:
        fields = table.get("fields")
        model = _model(read, f"{place}.fields", cls.Goal, fields, expose_all=expose == "all")
    if len(read.problems) > before or model is None:
        return None
    assert timeout is not None
    return ActionConfig(
        name=name,
        action=action,
        ros_type=ros_type,
        cls=cls,
        description=description or f"Sends a goal to the action {action} ({ros_type}).",
        timeout=timeout,
        concurrent=concurrent or 1,
        confirm=confirm == "always",
        retries=retries or 0,
        model=model,
        warnings=tuple(_warnings(model, said=expose is not None)),
    )


def _warnings(model: GoalModel, *, said: bool) -> Iterator[str]:
    if model.unlimited:
        numbers = ", ".join(model.unlimited)
        yield f"numbers without limits: {numbers}; set minimum and maximum, or enum"
    if model.unlisted and not said:
        # Files from before `expose` mean all.
        yield (
            f"{len(model.unlisted)} fields are not listed, so a model cannot set them (actionkit"
            ' mcp FILE --check names them); set expose = "listed" if this is meant, or "all"'
        )


def _model(
    read: Reader, place: str, goal: type, fields: object, *, expose_all: bool
) -> GoalModel | None:
    try:  # not with this module: importing it is slow, and needs pydantic
        from actionkit.agents._config_fields import read_fields
    except ImportError as error:
        raise ImportError(f"{error}; pip install pydantic") from error
    return read_fields(read, place, goal, fields, expose_all=expose_all)


def _topic(read: Reader, name: str, content: object) -> TopicConfig | None:
    place = f"topics.{name}"
    before = len(read.problems)
    _check_name(read, place, name)
    table = read.table(place, content, _TOPIC_KEYS)
    topic = read.text(f"{place}.topic", table.get("topic"), needed=True)
    _check_ros_name(read, f"{place}.topic", topic)
    ros_type = read.text(f"{place}.type", table.get("type"), needed=True)
    cls = _cls(read, f"{place}.type", ros_type, "msg")
    description = read.text(f"{place}.description", table.get("description"))
    max_age = read.number(f"{place}.max_age", table.get("max_age"), 0.0, MOST)
    max_size = read.whole(f"{place}.max_size", table.get("max_size", _MAX_SIZE), 1, 100_000)
    if len(read.problems) > before:
        return None
    return TopicConfig(
        name=name,
        topic=topic,
        ros_type=ros_type,
        cls=cls,
        description=description or f"Reads the latest message of the topic {topic} ({ros_type}).",
        max_age=max_age,
        max_size=max_size or _MAX_SIZE,
    )


def _check_name(read: Reader, place: str, name: str) -> None:
    if name == GOALS:
        read.add(place, "the name 'goals' is taken: every toolbox has this tool; choose another")
    elif not _NAME.fullmatch(name):
        read.add(place, "a tool's name has 1 to 64 letters, digits, '_' and '-' only")


def _check_ros_name(read: Reader, place: str, name: str) -> None:
    if name and not _ROS_NAME.fullmatch(name):
        read.add(place, f"{name!r} is no ROS name, such as '/arm/pick'")


def _cls(read: Reader, place: str, ros_type: str, kind: Any) -> Any:
    if not ros_type:
        return None
    try:
        return interface_class(ros_type, kind)
    except ValueError as error:
        read.add(place, str(error))
        return None

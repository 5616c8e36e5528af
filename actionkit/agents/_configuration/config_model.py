"""The tables of a configuration, as pydantic checks them.

Importing this is slow (pydantic, rosidl_parser); it is loaded with the first configuration.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cached_property
from typing import Annotated, Any, ClassVar, Literal, TypeVar

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Field,
    PlainValidator,
    Strict,
    ValidationError,
    ValidationInfo,
    field_validator,
    model_validator,
)

from actionkit._messages.by_name import Kind, interface_class
from actionkit._model.environment.domain import LAST_DOMAIN
from actionkit._model.settings import MOST
from actionkit.agents._arguments.goal_model import GoalModel
from actionkit.agents._arguments.limits import Table
from actionkit.agents._arguments.problems import Place, refuse, sentences
from actionkit.agents._configuration.config_fields import read_fields
from actionkit.agents._values import GOALS, ConfigError

_NAME = re.compile(r"[A-Za-z0-9_-]{1,64}")
"""The names of tools that the APIs of language models accept."""
_ROS_NAME = re.compile(r"/?[A-Za-z_]\w*(/[A-Za-z_]\w*)*", re.ASCII)


def _tool_name(name: str) -> str:
    if name == GOALS:
        raise ValueError("the name 'goals' is taken: every toolbox has this tool; choose another")
    if not _NAME.fullmatch(name):
        raise ValueError("a tool's name has 1 to 64 letters, digits, '_' and '-' only")
    return name


def _ros_name(name: str) -> str:
    if not _ROS_NAME.fullmatch(name):
        raise ValueError(f"{name!r} is not a ROS name, such as '/arm/pick'")
    return name


def _goal_model(content: object, info: ValidationInfo) -> GoalModel | None:
    if "ros_type" not in info.data:  # it is wrong, and its own error says so
        return None
    goal = interface_class(info.data["ros_type"], "action").Goal
    everything = info.data.get("expose") == "all"
    return read_fields(goal, {} if content is None else content, expose_all=everything)


_RosName = Annotated[str, AfterValidator(_ros_name)]


class _Tool(Table):
    """The keys that all tools have.

    Attributes:
        kind: Which kind of type they need: "action" or "msg".
        ros_type: Such as `nav2_msgs/action/NavigateToPose`.
        description: For the model.
    """

    kind: ClassVar[Kind]
    ros_type: str = Field(alias="type")
    description: str | None = None
    _name: str = ""

    @field_validator("ros_type")
    @classmethod
    def _installed(cls, ros_type: str) -> str:
        interface_class(ros_type, cls.kind)
        return ros_type

    @property
    def name(self) -> str:
        """The tool's name."""
        return self._name

    @cached_property
    def cls(self) -> Any:
        """The type's class."""
        return interface_class(self.ros_type, self.kind)


class ActionConfig(_Tool):
    """A tool that sends goals.

    Attributes:
        action: The action's name.
        timeout: Seconds for the wait for a server, the goal and all retries.
        concurrent: The most goals at a time.
        confirm: Whether a human approves each goal.
        retries: How often to send the goal again after a failure that may pass.
        expose: Which fields a model sees. `None` means "listed", with a warning: in files from
            before this key, it meant all.
        fields: The goal's fields with their limits.
    """

    kind = "action"
    action: _RosName
    timeout: Annotated[float, Field(gt=0, le=MOST)] = 60.0
    concurrent: Annotated[int, Field(ge=1, le=1000)] = 1
    confirm: Literal["never", "always"] = "never"
    retries: Annotated[int, Field(ge=0, le=1000)] = 2
    expose: Literal["listed", "all"] | None = None
    fields: Annotated[GoalModel, PlainValidator(_goal_model)] = Field(None, validate_default=True)

    def warnings(self) -> Iterator[str]:
        """Yield warnings: what is allowed, but may be a mistake."""
        if self.fields.unlimited:
            numbers = ", ".join(self.fields.unlimited)
            yield f"numbers without limits: {numbers}; set minimum and maximum, or enum"
        if self.fields.unlisted and self.expose is None:
            yield (
                f"{len(self.fields.unlisted)} fields are not listed, so a model cannot set them"
                ' (actionkit mcp FILE --check names them); set expose = "listed" if this is meant,'
                ' or "all"'
            )


class TopicConfig(_Tool):
    """A tool that reads a topic.

    Attributes:
        topic: The topic's name.
        max_age: Seconds; an older message counts as none. `None` takes any.
        max_size: Pixels of an image's longer side; of other messages, elements of an array.
    """

    kind = "msg"
    topic: _RosName
    max_age: Annotated[float, Field(gt=0, le=MOST)] | None = None
    max_size: Annotated[int, Field(ge=1, le=100_000)] = 768


_T = TypeVar("_T", bound=_Tool)


def _named(tools: dict[str, _T]) -> dict[str, _T]:
    for name, tool in tools.items():
        tool._name = name
    return tools


_Tools = Annotated[
    dict[Annotated[str, AfterValidator(_tool_name)], _T],
    Strict(False),  # any mapping
    BeforeValidator(lambda tables: {} if tables is None else tables),
    AfterValidator(_named),
]


class DomainOnly(Table):
    """The one setting that a program can also give as an argument."""

    domain_id: Annotated[int, Field(ge=0, le=LAST_DOMAIN)] | None = None


class Config(DomainOnly):
    """A whole configuration.

    Attributes:
        domain_id: The ROS domain; `None` takes the environment's.
        tools: Those that send goals, by name.
        topics: Those that read topics.
    """

    tools: _Tools[ActionConfig] = Field({})
    topics: _Tools[TopicConfig] = Field({})

    @model_validator(mode="after")
    def _fit_together(self) -> Config:
        found: list[tuple[Place, str]] = [
            (("topics", name), f"there is a tool {name!r} in [tools], too; rename one")
            for name in self.topics
            if name in self.tools
        ]
        types: dict[str, str] = {}
        for name, tool in self.tools.items():
            known = types.setdefault(tool.action, tool.ros_type)
            if known != tool.ros_type:
                text = f"another tool says that {tool.action!r} has the type {known!r}"
                found.append((("tools", name, "type"), text))
        if not self.tools and not self.topics:
            found.append(((), "there are no tools; add a table [tools.NAME] or [topics.NAME]"))
        refuse(found)
        return self


_Model = TypeVar("_Model", bound=Table)


def checked(model: type[_Model], content: object, source: str) -> _Model:
    """Check a configuration, and return it as a model.

    Raises:
        ConfigError: It is wrong.
    """
    try:
        return model.model_validate(content)
    except ValidationError as error:
        texts = sentences(error, model.model_json_schema(), "key", source)
        raise ConfigError(tuple(texts)) from None

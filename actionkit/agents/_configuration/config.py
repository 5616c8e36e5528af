"""The configuration of a toolbox: read as a whole, every problem told with its place."""

from __future__ import annotations

import importlib
import logging
import sys
from os import PathLike, fspath
from typing import TYPE_CHECKING, Any

from actionkit.agents._values import ConfigError

if TYPE_CHECKING:
    from actionkit.agents._configuration.config_model import ActionConfig, Config, TopicConfig
else:  # importing them is slow, and needs pydantic
    ActionConfig = Config = TopicConfig = Any

_log = logging.getLogger("actionkit")
__all__ = ["ActionConfig", "Config", "TopicConfig", "check_domain", "read_config", "read_file"]


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
        config = toml.loads(content.decode("utf-8-sig"))
    except (ValueError, RecursionError) as error:  # also numbers of thousands of digits
        raise ConfigError((f"{source}: this is not TOML: {error}",)) from error
    return read_config(config, source)


def read_config(config: object, source: str = "configuration") -> Config:
    """Read a configuration that is nested mappings.

    Raises:
        ConfigError: It is wrong.
        ImportError: The extra `agents` is not installed.
    """
    models = _models()
    found: Config = models.checked(models.Config, config, source)
    for name, tool in found.tools.items():
        for warning in tool.warnings():
            _log.warning("%s: tools.%s: %s", source, name, warning)
    return found


def check_domain(domain_id: object) -> int | None:
    """Return a domain that was given as an argument.

    Raises:
        ConfigError: It is not a ROS domain.
        ImportError: The extra `agents` is not installed.
    """
    models = _models()
    found: Config = models.checked(models.DomainOnly, {"domain_id": domain_id}, "arguments")
    return found.domain_id


def _models() -> Any:
    try:
        return importlib.import_module("actionkit.agents._configuration.config_model")
    except ImportError as error:
        raise ImportError(f"{error}; pip install pydantic") from error

"""Agents: actions and topics of a robot as tools for a language model, within limits.

    async with Toolbox.from_file("robot.toml") as toolbox:
        result = await toolbox.call("navigate", {"pose": {"position": {"x": 1.0}}})

Needs the extra `agents`: `pip install -e '.[agents]'` in a checkout. Importing this does not import
rclpy; using a `Toolbox` does.
"""

from actionkit.agents._toolbox import Toolbox
from actionkit.agents._values import (
    ApprovalRequest,
    ConfigError,
    Image,
    Progress,
    Tool,
    ToolResult,
)

__all__ = [
    "ApprovalRequest",
    "ConfigError",
    "Image",
    "Progress",
    "Tool",
    "ToolResult",
    "Toolbox",
]

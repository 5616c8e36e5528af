"""Finds the full name of an action, as a node of the user's would resolve it (contract C1.2)."""

from __future__ import annotations

import unicodedata
from dataclasses import dataclass
from typing import Any

from rclpy.exceptions import InvalidServiceNameException, InvalidTopicNameException
from rclpy.node import Node

from actionkit._ros.native import RCLError

_NOT_TEXT = ("Cc", "Cs")
"""Control characters, NUL among them, and halves of a character (surrogates)."""


@dataclass(frozen=True)
class Identity:
    """Which action a client is for.

    Attributes:
        action_name: The fully qualified name.
        type_name: Such as `test_msgs/action/Fibonacci`.
        domain_id: The ROS domain.
        label: The full name of the user's node, for logs; `""` where there is none.
    """

    action_name: str
    type_name: str
    domain_id: int
    label: str


def type_name_of(action_type: Any) -> str:
    """Return the ROS name of an action class.

    Raises:
        TypeError: It is no action class.
    """
    wanted = ("Goal", "Result", "Feedback", "Impl")
    if not isinstance(action_type, type) or not all(hasattr(action_type, n) for n in wanted):
        raise TypeError(
            f"action_type={action_type!r} must be an action class, such as"
            " test_msgs.action.Fibonacci; not a message, a service, or its Goal"
        )
    package = action_type.__module__.split(".", 1)[0]
    return f"{package}/action/{action_type.__name__}"


def resolve(node: Node, action_name: object) -> str:
    """Return the fully qualified name that `action_name` means to `node`.

    The remapping of the action's own name counts too, which rclpy's `ActionClient` ignores.

    Raises:
        TypeError: The name is no string.
        ValueError: It is no valid action name.
    """
    if not isinstance(action_name, str):
        raise TypeError(f"action_name={action_name!r} must be a string, such as 'fibonacci'")
    if any(unicodedata.category(character) in _NOT_TEXT for character in action_name):
        # The middleware reads a name up to its first NUL only, and would call another action.
        raise ValueError(
            f"action_name={action_name!r} has control characters or others that are no text."
            " Remove them: a ROS name has letters, digits, underscores and slashes only"
        )
    try:
        # This also checks the characters, which resolving the topic's name alone does not.
        node.resolve_service_name(f"{action_name}/_action/send_goal")
        return str(node.resolve_topic_name(action_name))
    except (InvalidTopicNameException, InvalidServiceNameException, RCLError) as error:
        # "failed to resolve name: the reason, at file.c:1"
        reason = str(error).split(": ", 1)[-1].rsplit(", at ", 1)[0]
        raise ValueError(f"action_name={action_name!r} is no valid ROS name: {reason}") from error

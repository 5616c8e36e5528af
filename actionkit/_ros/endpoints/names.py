"""Resolves the names of an action for a user's node, as rclpy does (contract C1.2).

An action has five names, and a node's remapping rules may map them to different places. They are
resolved once, on the node with the rules, and used unchanged on a node without rules.
"""

from __future__ import annotations

import unicodedata
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from rclpy.exceptions import (
    InvalidHandle,
    InvalidServiceNameException,
    InvalidTopicNameException,
)
from rclpy.node import Node

from actionkit._ros.rclpy_private.native import RCLError
from actionkit._ros.rclpy_private.release import is_kilted_or_later

_NOT_TEXT = ("Cc", "Cs")
"""Control characters, such as NUL, and half characters (surrogates)."""


_SEND_GOAL = "/_action/send_goal"


@dataclass(frozen=True)
class ActionNames:
    """The fully qualified names of an action."""

    action: str  # the name of the goal service, without the part that all of these end in
    send_goal: str
    get_result: str
    cancel_goal: str
    feedback: str
    status: str

    @classmethod
    def of(
        cls,
        action_name: str,
        service: Callable[[str], str] = str,
        topic: Callable[[str], str] = str,
    ) -> ActionNames:
        """Return the names of an action.

        `service` and `topic` resolve names; without them, names are already fully qualified.
        """
        send_goal = service(action_name + _SEND_GOAL)
        return cls(
            action=send_goal.removesuffix(_SEND_GOAL),
            send_goal=send_goal,
            get_result=service(f"{action_name}/_action/get_result"),
            cancel_goal=service(f"{action_name}/_action/cancel_goal"),
            feedback=topic(f"{action_name}/_action/feedback"),
            status=topic(f"{action_name}/_action/status"),
        )


@dataclass(frozen=True)
class Identity:
    """Identifies the action of a client."""

    action_name: str  # fully qualified
    type_name: str  # such as `test_msgs/action/Fibonacci`
    domain_id: int
    label: str  # the full name of the user's node, for logs; `""` if there is none


def check_name(action_name: object, *, has_node: bool) -> str:
    """Return the name if it may be valid; with a node, it may also be relative to the node.

    Raises:
        TypeError: The name is not a string.
        ValueError: No node could resolve it.
    """
    if not isinstance(action_name, str):
        raise TypeError(f"action_name={action_name!r} must be a string, such as 'fibonacci'")
    if any(unicodedata.category(character) in _NOT_TEXT for character in action_name):
        # The middleware reads a name only up to its first NUL, and would call another action.
        raise ValueError(
            f"action_name={action_name!r} has control characters or others that are no text."
            " Remove them: a ROS name has letters, digits, underscores and slashes only"
        )
    if not has_node and (action_name.startswith("~") or "{node}" in action_name):
        raise ValueError(
            f"action_name={action_name!r} is a name below a node, and there is none: give node="
            " the node that is meant, or give the whole name"
        )
    return action_name


def resolve(node: Node, action_name: str) -> ActionNames:
    """Return the names that `action_name` means for `node`, which has the rules.

    The node's rules for each of the five names count, as for rclpy's `ActionClient`. If there are
    none, a rule for the action's own name counts, too; rclpy's client of Jazzy ignores such a
    rule. From ROS 2 Kilted on, rclpy applies it first, and then those for the five names to what
    it gives; so does this.

    Raises:
        ValueError: It is not a valid action name, or one of the five is not valid after remapping;
            or the node was destroyed.
    """

    def told(resolver: Callable[[str], str]) -> Callable[[str], str]:
        return partial(_resolved, resolver, action_name)

    service, topic = told(node.resolve_service_name), told(node.resolve_topic_name)
    try:
        expanded = told(partial(node.resolve_topic_name, only_expand=True))(action_name)
        names = ActionNames.of(expanded, service, topic)
        if is_kilted_or_later() or names == ActionNames.of(expanded):
            names = ActionNames.of(topic(action_name), service, topic)
    except InvalidHandle as error:
        raise ValueError(f"node={node!r} was destroyed: give one that is in use") from error
    return names


def _resolved(resolver: Callable[[str], str], action_name: str, name: str) -> str:
    """Return one name, resolved.

    Raises:
        ValueError: It is not a valid name, or what it is remapped to is not.
    """
    try:
        return resolver(name)
    except (InvalidTopicNameException, InvalidServiceNameException, RCLError) as error:
        # "failed to resolve name: the reason, at file.c:1"
        reason = str(error).split(": ", 1)[-1].rsplit(", at ", 1)[0]
        reason = reason.replace("'255U - 8U'", "247 characters")
        which = f"action_name={action_name!r}"
        if name != action_name:
            which += f" cannot be used: its {name!r}, or what that is remapped to,"
        raise ValueError(f"{which} is not a valid ROS name: {reason}") from error

"""Gets the goal of a leaf: a fixed one, from a function, or from the blackboard."""

from __future__ import annotations

import inspect
import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from py_trees.blackboard import Blackboard
from py_trees.blackboard import Client as BlackboardClient
from py_trees.common import Access

from actionkit._internal_api import log_later
from actionkit._messages.convert import from_plain
from actionkit._model.arguments import check_function


class NoGoalError(Exception):
    """There is no goal to send. The text is a sentence for the tree's node."""


@dataclass(frozen=True)
class FromBlackboard:
    """Takes the goal of a behaviour from the blackboard when the goal is sent.

    Attributes:
        key: The name of the value, such as `"target"`, `"/mission/target"` or `"mission.target"`
            (an attribute of the value of `mission`). The value is a goal message, or a mapping of
            its fields.

    Raises:
        TypeError: The key is not a string.
        ValueError: The key is empty.
    """

    key: str

    def __post_init__(self) -> None:
        check_key("FromBlackboard key", self.key, nested=True)


def check_key(name: str, key: object, *, nested: bool = False) -> None:
    """Raise if this cannot be the key of a blackboard variable.

    Raises:
        TypeError: It is not a string.
        ValueError: It is empty, or has a dot that is not allowed.
    """
    if not isinstance(key, str):
        raise TypeError(f"{name}={key!r} must be a text, the name of a blackboard variable")
    if not key.strip("/. "):
        raise ValueError(f"{name}={key!r} must be the name of a blackboard variable")
    if "." in key and not nested:
        raise ValueError(
            f"{name}={key!r} must name a variable of its own, without a dot: it is written whole"
        )


class GoalSource:
    """Provides the goal to send."""

    def __init__(self, goal: object, goal_class: type, board: BlackboardClient) -> None:
        """Check the user's goal: a message, a mapping, a function, or `FromBlackboard`.

        `board` is the behaviour's blackboard client, which gets read access.

        Raises:
            TypeError, ValueError: It is none of these, or does not fit the action's goal.
        """
        self.label = ""
        """Where the goal comes from, as the beginning of a sentence; `""` for a fixed goal."""
        self._board = board
        if isinstance(goal, FromBlackboard):
            self.label = f"the goal under the blackboard key {goal.key!r} is not right: "
            board.register_key(key=Blackboard.key(goal.key), access=Access.READ)
            self._get: Callable[[Any], Any] = lambda _: self._read(goal.key)
        elif isinstance(goal, Mapping) or (not inspect.isclass(goal) and _is_message(goal)):
            message = from_plain(goal_class, goal)  # a copy, because the original may change
            self._get = lambda _: message
        else:
            wanted = (
                f"a {goal_class.__name__.rpartition('_')[0]}.Goal message, a mapping of its fields,"
                " a function (behaviour) -> goal, or FromBlackboard(key)"
            )
            check_function("goal", goal, wanted)
            assert callable(goal)
            self.label = "what the function for the goal returned is not right: "
            function: Callable[[Any], Any] = goal
            self._get = lambda behaviour: _ask(function, behaviour)

    def goal(self, behaviour: object) -> Any:
        """Return the goal to send now.

        Raises:
            NoGoalError: There is no goal.
        """
        return self._get(behaviour)

    def _read(self, key: str) -> Any:
        try:
            return self._board.get(key)
        except (KeyError, AttributeError):
            raise NoGoalError(
                f"nothing stands on the blackboard under the key {key!r}: write the goal there"
                " before this behaviour is ticked"
            ) from None


def _is_message(value: object) -> bool:
    return hasattr(value, "get_fields_and_field_types")


def _ask(function: Callable[[Any], Any], behaviour: object) -> Any:
    try:
        return function(behaviour)
    except Exception as error:  # noqa: BLE001  the user's function may raise any error
        log_later(logging.ERROR, "the function for a goal raised", exc_info=error)
        raise NoGoalError(
            f"the function for the goal raised {type(error).__name__}: {error}; nothing was sent"
        ) from None

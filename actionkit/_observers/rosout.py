"""Writes events to the log of a ROS node, and so to the topic /rosout."""

from __future__ import annotations

import inspect
import logging
from typing import Any

from actionkit._model.values import GoalEvent, Outcome
from actionkit._observers.protocol import CallInfo
from actionkit._observers.words import level_of, level_of_outcome, outcome_sentence, sentence


class Rosout:
    """An observer that writes to the logger of your node, and so to /rosout.

        Client(NavigateToPose, "navigate_to_pose", node=node, observers=[Rosout(node)])

    Levels and texts are the same as in the log `actionkit.goal`. After the node's ROS context was
    shut down, nothing is written.
    """

    def __init__(self, node: Any) -> None:
        """Take the node's logger.

        Args:
            node: An rclpy node. The observer does not spin or change it. You may destroy the node
                while the observer is in use.

        Raises:
            TypeError: `node` has no logger.
        """
        if inspect.isclass(node) or not callable(getattr(node, "get_logger", None)):
            raise TypeError(f"Rosout: node={node!r} must be an rclpy node")
        self._logger = node.get_logger()
        self._context = getattr(node, "context", None)

    def __repr__(self) -> str:
        return f"<Rosout {getattr(self._logger, 'name', '')!r}>"

    def on_event(self, event: GoalEvent, call: CallInfo) -> None:
        """Write a transition."""
        self._write(level_of(event), sentence(event, call.action_name, call.elapsed_ms(event)))

    def on_outcome(self, outcome: Outcome[Any], call: CallInfo) -> None:
        """Write the end of a call."""
        self._write(level_of_outcome(outcome), outcome_sentence(outcome, call.action_name))

    def _write(self, level: int, text: str) -> None:
        if self._context is not None and not self._context.ok():
            return  # it was shut down: rclpy would write an error for each line
        # A line of code for each level: rclpy remembers the level of each line that logs, and
        # refuses another level there.
        if level >= logging.WARNING:
            self._logger.warning(text)
        elif level >= logging.INFO:
            self._logger.info(text)
        else:
            self._logger.debug(text)

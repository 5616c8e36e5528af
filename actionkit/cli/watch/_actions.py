"""Reads the goals of one action, or of all in sight, and passes each change to the screens."""

from __future__ import annotations

import queue
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

from actionkit._messages.by_name import interface_class
from actionkit._messages.convert import to_plain
from actionkit._ros.endpoints import graph
from actionkit._ros.holds.state import Hold
from actionkit._ros.others_goals.goal_board import Board, WatchedGoal, arrived
from actionkit._ros.others_goals.survey import Survey
from actionkit._ros.others_goals.watch import StatusReader, read_feedback
from actionkit.cli._shared.say import say
from actionkit.cli.watch._screens import Screen, Watched

_LOOK = 1.0
"""Seconds between two looks for new actions, and for types that are not known yet."""
_PERIOD, _PERIOD_OF_ONE = 2.0, 0.25
"""Seconds between two checks for the servers of each of many actions, and for those of one. A check
takes a third of a millisecond."""
_GONE = 60.0
"""Seconds without a server after which an action is forgotten, so that a watch of days stays small.
A server that is restarted is back sooner."""
_MOST_ITEMS = 100
"""Elements of an array in a feedback message that are shown, as by `JsonLines`."""


class Actions:
    """The actions that are watched. A context manager; all but `put` is for one thread."""

    def __init__(self, survey: Survey, name: str, *, feedback: bool) -> None:
        """Watch the action of this full name, or all if it is `""`."""
        self.screens: list[Screen] = []
        self.holds: tuple[Hold, ...] = ()
        """The holds of people who have stopped the robot by `actionkit stop`."""
        self.by_name: dict[str, Watched] = {}
        self._survey, self._name, self._feedback = survey, name, feedback
        self._inbox: queue.SimpleQueue[Callable[[], object]] = queue.SimpleQueue()
        self._next_look = 0.0
        self.put = self._inbox.put
        """Let `take` call a function. From any thread."""

    def take(self, timeout: float) -> None:
        """Wait for news; pass on all that is there, and look for new actions if it is time."""
        for call in arrived(self._inbox, timeout):
            call()
        if time.monotonic() >= self._next_look:
            self.look()

    def hold(self, holds: tuple[Hold, ...]) -> None:
        """Record who has stopped the robot."""
        if holds != self.holds:
            self.holds = holds
            for screen in self.screens:
                screen.hold(holds)

    def look(self) -> None:
        """Look for new actions and for their types; forget those that have gone."""
        now, node = time.monotonic(), self._survey.runtime.node
        self._next_look = now + _LOOK
        types = graph.action_types(node)
        for name in [self._name] if self._name else sorted({*types, *self.by_name}):
            served = self._name or node.count_publishers(self._survey.names(name).feedback)
            if served and name not in self.by_name:
                self._start(name)
            if (action := self.by_name.get(name)) is None:
                continue
            action.type = ", ".join(types.get(name, ())) or action.type
            if served:
                action.in_sight = now
                if self._feedback and action.type and not action.asked_for_feedback:
                    self._read_feedback(action)
            elif now - action.in_sight > _GONE:
                del self.by_name[name]
                action.close()

    def _start(self, name: str) -> None:
        action = self.by_name[name] = Watched(name, Board(apart=True))

        def put(news: Any) -> None:
            self.put(partial(self._update, action, news, time.time()))

        period = _PERIOD_OF_ONE if self._name else _PERIOD
        names = self._survey.names(name)
        reader = StatusReader(names, on_goals=put, on_servers=put, period=period)
        action.readers.append(reader)

    def _update(self, action: Watched, news: Any, at: float) -> None:
        changed, servers = action.board.take(news, at)
        count = len(action.board.servers)
        action.most_servers = max(count, action.most_servers) if count else 0
        if not action.type:
            self.look()
        for screen in self.screens:
            if servers:
                screen.servers(action)
            for goal in changed:
                screen.goal(action, goal)

    def _read_feedback(self, action: Watched) -> None:
        def put(goal_id: str, decode: Callable[[], Any]) -> None:
            self.put(partial(self._show_feedback, action, goal_id, decode, time.time()))

        action.asked_for_feedback = True
        try:
            cls = interface_class(action.type, "action")
            reader = read_feedback(self._survey.names(action.name), cls, put, _PERIOD)
            action.readers.append(reader)
        except Exception as error:  # noqa: BLE001  of a package that is missing or broken
            say(f"No feedback of {action.name}: {action.type}: {error}", err=True)

    def _show_feedback(
        self, action: Watched, goal_id: str, decode: Callable[[], Any], at: float
    ) -> None:
        try:
            fields = to_plain(decode(), max_items=_MOST_ITEMS)
        except Exception:  # noqa: BLE001  a message that is cut off
            return
        known = [goal for goal in action.board.goals.values() if goal.goal_id == goal_id]
        # A server of micro-ROS publishes no status.
        goal = known[-1] if known else WatchedGoal(goal_id, "", at, at)
        for screen in self.screens:
            screen.goal(action, replace(goal, state="FEEDBACK", since=at, before=""), fields)

    def __enter__(self) -> Actions:
        self.look()
        return self

    def __exit__(self, *_: object) -> None:
        for action in self.by_name.values():
            action.close()

"""Cancels goals of actions that are in sight, and follows them until they have ended."""

from __future__ import annotations

import contextlib
import queue
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from actionkit._ros.cancelling.cancelling import Cancelling, Fate
from actionkit._ros.others_goals.goal_board import arrived

if TYPE_CHECKING:
    from actionkit._ros.cancelling.cancel import GoalCanceller
    from actionkit._ros.others_goals.survey import Survey

_TICK = 0.05
"""Seconds between two looks at the graph."""
_ANSWER = 1.0
"""Seconds for the answers to the last request, even if the time is over."""


def cancel_goals(
    survey: Survey,
    actions: list[Cancelling],
    *,
    over: Callable[[float], bool],
    look: float,
    least: float | None = None,
    accepted_until: float = 0.0,
    on_fate: Callable[[Fate], object] = lambda _: None,
    on_error: Callable[[str, Exception], object] = lambda *_: None,
) -> None:
    """Cancel goals until it is known what happened to each, or the time is `over`.

    Args:
        survey: Sees the actions. The goals are cancelled from its place.
        actions: The goals of these are cancelled.
        over: Whether the time is over. Asked often, with the time on the monotonic clock.
        look: Seconds to look for servers at least, even if the time is over; a server that is not
            seen at once is seen within 3 s.
        least: The same, from when each action has a server: there may be a second one, and the
            status may come later. `None` means that all actions that come into sight are added. In
            the end, those without a server are added, too, if clients of theirs may have goals.
        accepted_until: Requests for all goals count for those that were accepted until then, in
            seconds since the epoch by the server's clock; 0 means for all.
        on_fate: Gets each fate when it is known.
        on_error: Gets the name of each action with goals that cannot be cancelled, and the error.
    """
    began = time.monotonic()
    complete: float | None = None
    """Since when each action has a server."""
    last: float | None = None
    """Until when the answers to the last request may come; it is sent after looking for servers."""
    with contextlib.ExitStack() as stack:
        asking = _Asking(survey, actions, stack, adds=least is None, on_error=on_error)
        while True:
            asking.look()
            asking.take_answers()
            now = time.monotonic()
            if complete is None and all(action.has_server for action in actions):
                complete = now
            if least is None or complete is None:
                looked = now - began >= look
            else:
                looked = now - complete >= least
            if looked and last is None:
                last = now + _ANSWER
                for action in actions:
                    action.once_more()
            asking.ask(now, accepted_until, on_fate)
            if last is not None and (asking.done or (over(now) and now >= last)):
                break
    for name in survey.actions() if least is None else ():
        if name not in asking.by_name and survey.may_hide_goals(name):
            actions.append(Cancelling(name))


class _Asking:
    """Asks the servers in sight, and takes their answers."""

    def __init__(
        self,
        survey: Survey,
        actions: list[Cancelling],
        stack: contextlib.ExitStack,
        *,
        adds: bool,
        on_error: Callable[[str, Exception], object],
    ) -> None:
        """Begin without servers; `adds` means that actions are added when they come into sight.

        The `stack` closes what is opened. For the rest, see `cancel_goals`.
        """
        self._survey = survey
        self._actions = actions
        self._stack = stack
        self._adds = adds
        self._on_error = on_error
        self.by_name = {action.name: action for action in actions}
        self._cancellers: dict[str, GoalCanceller] = {}
        self._broken: set[str] = set()
        """Names that rclpy refuses; the program that made them does not use rclpy."""
        self._inbox: queue.SimpleQueue[tuple[Cancelling, Any]] = queue.SimpleQueue()

    @property
    def done(self) -> bool:
        """Whether nothing is left to do about the actions that have, or had, a server."""
        return all(self.by_name[name].done for name in self._cancellers)

    def look(self) -> None:
        """Look which servers are in sight."""
        for seen in self._survey.actions().values():
            if not seen.servers or not (self._adds or seen.name in self.by_name):
                continue
            if seen.name not in self.by_name:
                self.by_name[seen.name] = Cancelling(seen.name)
                self._actions.append(self.by_name[seen.name])
            if seen.name not in self._cancellers and seen.name not in self._broken:
                try:
                    self._open(seen.name)
                except Exception as error:  # noqa: BLE001  cancel those of the other actions
                    self._broken.add(seen.name)
                    self._on_error(seen.name, error)
            self.by_name[seen.name].seen([end.node for end in seen.servers])

    def _open(self, name: str) -> None:
        from actionkit._ros.cancelling.cancel import GoalCanceller
        from actionkit._ros.others_goals.watch import StatusReader

        put = _putter(self._inbox, self.by_name[name])
        names, place = self._survey.names(name), self._survey.place
        reader = StatusReader(names, on_goals=put, on_servers=put, place=place)
        self._stack.callback(reader.close)
        self._cancellers[name] = GoalCanceller(names, put, place)
        self._stack.callback(self._cancellers[name].close)

    def take_answers(self) -> None:
        """Take what has come from the servers, or wait a moment for it."""
        from actionkit._ros.cancelling.cancel import AllSaid, CancelSaid

        for action, news in arrived(self._inbox, _TICK):
            if isinstance(news, AllSaid):
                action.take_all(news, time.monotonic())
            elif isinstance(news, CancelSaid):
                action.take(news, time.monotonic())
            else:
                action.take_news(news, time.time())

    def ask(self, now: float, accepted_until: float, on_fate: Callable[[Fate], object]) -> None:
        """Send the requests that are due, and tell what is known now."""
        for name, canceller in self._cancellers.items():
            action = self.by_name[name]
            if (number := action.to_ask(now)) is not None:
                canceller.cancel_all(number, until=accepted_until)
            for goal_id in action.to_ask_singly(now):
                canceller.cancel(goal_id)
            for fate in action.settle(now, over=False):
                canceller.stop(fate.goal_id)
                on_fate(fate)


def _putter(inbox: queue.SimpleQueue[Any], action: Cancelling) -> Callable[[Any], None]:
    return lambda news: inbox.put((action, news))

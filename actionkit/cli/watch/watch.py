"""`actionkit watch`: show the states of all goals of an action, also of other clients."""

from __future__ import annotations

import math
import queue
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import click

from actionkit._ros.others_goals.goal_board import FIRST
from actionkit.cli._shared.exits import Exit
from actionkit.cli._shared.options import HELP, SECONDS, debug_option, json_option, name_argument
from actionkit.cli._shared.problems import full_name, open_survey
from actionkit.cli._shared.say import say
from actionkit.cli._shared.signals import watch_output

if TYPE_CHECKING:
    from actionkit._ros.holds.state import Hold
    from actionkit._ros.others_goals.goal_board import Board
    from actionkit.cli.watch._screens import Screen


@dataclass(frozen=True)
class Held:
    """A change of the holds: who has stopped the robot."""

    holds: tuple[Hold, ...]


TICK = 0.25
"""Seconds between two drawings of the table: often enough for tenths of a second to look alive."""
_NEXT_LOOK = 0.3
"""Seconds until a `StatusReader` has looked for servers again."""
NO_STATUS = (
    "No goal is known: no status has come from the server. It has had no goal yet, or publishes"
    " none, as that of micro-ROS: then it may be running some."
)
_CLOSED: Any = object()
"""Put into the inbox when nobody reads the output any more."""

_EPILOG = """\b
Examples:
  actionkit watch /fibonacci
  actionkit watch /fibonacci --once
  actionkit watch /fibonacci --for 60 --json > goals.jsonl

States come from the servers' status topic, which needs no package of the action's own. Ctrl-C
ends it."""


@click.command("watch", context_settings=HELP, epilog=_EPILOG)
@name_argument
@click.option("--once", is_flag=True, help="Show how the goals stand now, and leave.")
@click.option("--for", "seconds", type=SECONDS, help="Leave after so many seconds.")
@click.option(
    "--server-timeout",
    type=SECONDS,
    default=5.0,
    show_default=True,
    help="With --once: how long to wait for a server.",
)
@json_option("Write one JSON object for each change.")
@debug_option
def command(
    name: str, once: bool, seconds: float | None, server_timeout: float, as_json: bool
) -> int:
    """Show the goals of the action NAME as their states change, and whether agents are held."""
    if once and seconds is not None:
        raise click.UsageError("Give --once or --for, not both.")
    with open_survey() as survey:
        full = full_name(survey, name)

        from actionkit._ros.holds.view import HoldView
        from actionkit._ros.others_goals.goal_board import Board
        from actionkit._ros.others_goals.watch import StatusReader

        def type_of() -> str:
            action = survey.actions().get(full)
            return ", ".join(action.types) if action else ""

        board = Board()
        inbox: queue.SimpleQueue[Any] = queue.SimpleQueue()
        view = HoldView(
            None, "watch", speaks=False, on_change=lambda: inbox.put(Held(view.state.active))
        )
        view.start()
        reader = StatusReader(survey.names(full), on_goals=inbox.put, on_servers=inbox.put)
        try:
            if once:
                return _once(full, board, inbox, server_timeout, type_of if as_json else None)
            say(f"Watching the goals of {full}; Ctrl-C ends it.", err=True)
            watch_output(lambda: inbox.put(_CLOSED))
            return _follow(_screen(full, type_of if as_json else None), board, inbox, seconds)
        finally:
            reader.close()
            view.close()


def _screen(name: str, type_of: Callable[[], str] | None, *, once: bool = False) -> Screen:
    """Return the screen for the goals; with `type_of`, it is for programs."""
    from actionkit.cli.watch import _screens as screens

    if type_of is not None:
        return screens.JsonScreen(name, type_of)
    if once:
        return screens.TextScreen()
    return screens.TableScreen(name) if sys.stdout.isatty() else screens.TextScreen()


def _follow(
    screen: Screen, board: Board, inbox: queue.SimpleQueue[Any], seconds: float | None
) -> int:
    end = None if seconds is None else time.monotonic() + seconds
    with screen:
        while end is None or time.monotonic() < end:
            left = TICK if end is None else max(0.0, min(TICK, end - time.monotonic()))
            _take(board, inbox, left, screen)
            screen.tick(board)
    return Exit.OK


def _once(
    name: str,
    board: Board,
    inbox: queue.SimpleQueue[Any],
    server_timeout: float,
    type_of: Callable[[], str] | None,
) -> int:
    first_look(board, inbox, server_timeout)
    if not board.servers:
        say(f"Error: Action {name!r} has no server in sight.", err=True)
        return Exit.NO_SERVER
    with _screen(name, type_of, once=True) as screen:
        if board.holds:
            screen.hold(board)
        for goal in board.sorted():
            screen.goal(goal)
    if not board.goals and type_of is None:
        say("No goals: the server remembers none." if board.has_status else NO_STATUS)
    return Exit.OK


def first_look(board: Board, inbox: queue.SimpleQueue[Any], server_timeout: float) -> None:
    """Wait until a server is in sight, then a second at most for the goals it remembers.

    `inbox` gets what a `StatusReader` reports; the board is updated from it. Several servers get
    the whole second, from when the first is seen: what has ended on one may run on another.
    """
    give_up = time.monotonic() + server_timeout
    first = alone = math.inf
    while True:
        now = time.monotonic()
        if board.servers and first == math.inf:
            first = now + FIRST
        if board.goals and alone == math.inf:
            alone = now + _NEXT_LOOK
        if now >= min(first, give_up) or (len(board.servers) == 1 and now >= alone):
            break
        _take(board, inbox, TICK / 5, None)


def _take(
    board: Board, inbox: queue.SimpleQueue[Any], timeout: float, screen: Screen | None
) -> None:
    try:
        news = inbox.get(timeout=timeout)
    except queue.Empty:
        return
    if news is _CLOSED:
        raise BrokenPipeError
    if isinstance(news, Held):
        if news.holds != board.holds:
            board.holds = news.holds
            if screen is not None:
                screen.hold(board)
        return
    changed, servers = board.take(news, time.time())
    if screen is None:
        return
    if servers:
        screen.servers(board)
    for goal in changed:
        screen.goal(goal)

"""`actionkit watch`: show the states of all goals, also of other clients, of one action or all."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

import click

from actionkit._ros.others_goals.goal_board import FIRST
from actionkit.cli._shared.exits import Exit
from actionkit.cli._shared.options import (
    HELP,
    SECONDS,
    complete_names,
    debug_option,
    json_option,
)
from actionkit.cli._shared.problems import full_name, open_survey
from actionkit.cli._shared.say import say
from actionkit.cli._shared.signals import watch_output

if TYPE_CHECKING:
    from actionkit._ros.others_goals.goal_board import Board
    from actionkit._ros.others_goals.survey import Survey
    from actionkit.cli.watch._actions import Actions
    from actionkit.cli.watch._screens import Screen

_TICK = 0.5
"""Seconds between two drawings of the table. Each takes about two milliseconds."""
_STEP = 0.05
"""Seconds between two looks at the clock, with --once."""
_NEXT_LOOK = 0.3
"""Seconds until a `StatusReader` has looked for servers again."""
_MOST = 4.0
"""Seconds to look for actions at most, with --once and without NAME."""
NO_STATUS = (
    "No goal is known: no status has come from the server. It has had no goal yet, or publishes"
    " none, as that of micro-ROS: then it may be running some."
)

_EPILOG = """\b
Examples:
  actionkit watch
  actionkit watch /fibonacci --once
  actionkit watch --log goals.jsonl
  actionkit watch /fibonacci --for 60 --json > goals.jsonl

States come from the servers' status topic, which needs no package of the action's own. Ctrl-C
ends it. `actionkit timeline` draws what --log and --json write."""


@click.command("watch", context_settings=HELP, epilog=_EPILOG)
@click.argument("name", metavar="[NAME]", required=False, shell_complete=complete_names)
@click.option("--once", is_flag=True, help="Show how the goals stand now, and leave.")
@click.option("--for", "seconds", type=SECONDS, help="Leave after so many seconds.")
@click.option(
    "--server-timeout",
    type=SECONDS,
    default=5.0,
    show_default=True,
    help="With --once and NAME: how long to wait for a server.",
)
@click.option(
    "--feedback",
    is_flag=True,
    help="Show feedback, too, of each goal once a second at most. The action's type must be"
    " installed here.",
)
@click.option(
    "--log",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE",
    help="Write the lines of --json to this file, too. It can run for days: at 10 MB the file is"
    " renamed, and five older ones are kept.",
)
@json_option("Write one JSON object for each change.")
@debug_option
def command(
    name: str | None,
    once: bool,
    seconds: float | None,
    server_timeout: float,
    feedback: bool,
    log: Path | None,
    as_json: bool,
) -> int:
    """Show the goals of all actions, or of NAME, as they change, and whether agents are held."""
    if once and (seconds is not None or feedback):
        other = "--feedback" if feedback else "--for"
        raise click.UsageError(f"Give --once or {other}, not both.")
    with open_survey() as survey, ExitStack() as stack:
        full = "" if name is None else full_name(survey, name)

        from actionkit._observers.json_lines import RotatingFile
        from actionkit._ros.holds.view import HoldView
        from actionkit.cli.watch import _actions, _screens

        screens: list[Screen] = []
        if as_json:
            screens.append(_screens.JsonScreen())
        elif once or not sys.stdout.isatty():
            screens.append(_screens.TextScreen(named=not full))
        else:
            screens.append(_screens.TableScreen(full, feedback=feedback))
        if log is not None:
            try:
                file = RotatingFile(log.absolute())
            except OSError as error:
                raise click.BadParameter(f"{error}", param_hint="--log") from error
            stack.callback(file.close)
            screens.append(_screens.JsonScreen(file.write))

        actions = _actions.Actions(survey, full, feedback=feedback)
        view = HoldView(
            None,
            "watch",
            speaks=False,
            on_change=lambda: actions.put(lambda: actions.hold(view.state.active)),
        )
        stack.callback(view.close)
        view.start()
        stack.enter_context(actions)
        if once:
            return _once(survey, actions, screens, full, server_timeout, as_json)
        say(f"Watching the goals of {full or 'all actions'}; Ctrl-C ends it.", err=True)
        watch_output(lambda: actions.put(_closed))
        for screen in screens:
            stack.enter_context(screen)
        actions.screens += screens
        return _follow(actions, seconds)


def _closed() -> None:
    """Nobody reads the output any more."""
    raise BrokenPipeError


def _follow(actions: Actions, seconds: float | None) -> int:
    end = math.inf if seconds is None else time.monotonic() + seconds
    tick = 0.0
    while (now := time.monotonic()) < end:
        if now >= tick:
            tick = now + _TICK
            for screen in actions.screens:
                screen.tick([*actions.by_name.values()], actions.holds)
        actions.take(max(0.0, min(tick, end) - now))
    return Exit.OK


def _once(
    survey: Survey,
    actions: Actions,
    screens: list[Screen],
    name: str,
    server_timeout: float,
    as_json: bool,
) -> int:
    if name:
        first_look(actions.by_name[name].board, actions.take, server_timeout)
    else:
        survey.on_look.append(lambda _: actions.take(0.0))
        survey.settled(most=_MOST)
        actions.look()
        end = time.monotonic() + FIRST
        while (left := end - time.monotonic()) > 0:
            actions.take(left)
    actions.look()  # for types that were not known
    watched = list(actions.by_name.values())
    if not any(action.board.servers for action in watched):
        told = f"Action {name!r} has no" if name else "No action has a"
        say(f"Error: {told} server in sight.", err=True)
        return Exit.NO_SERVER
    for screen in screens:
        if actions.holds:
            screen.hold(actions.holds)
        for action in watched:
            for goal in action.board.sorted():
                screen.goal(action, goal)
    if not any(action.board.goals for action in watched) and not as_json:
        has_status = not name or watched[0].board.has_status
        say("No goals: no server remembers any." if has_status else NO_STATUS)
    return Exit.OK


def first_look(board: Board, take: Callable[[float], object], server_timeout: float) -> None:
    """Wait until a server is in sight, then a second at most for the goals it remembers.

    `take` waits so many seconds for news, and updates the board. Several servers get the whole
    second, from when the first is seen: what has ended on one may run on another.
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
        take(_STEP)

"""`actionkit cancel`: cancel goals of an action, those of other clients too."""

from __future__ import annotations

import queue
import time
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

import click

from actionkit._model.goal_ids import goal_id_of
from actionkit._model.settings import LONGEST_GRACE
from actionkit._observers.json_schema import note_line
from actionkit._ros.cancelling.cancel_goals import cancel_goals
from actionkit._ros.cancelling.cancelling import Cancelling, Fate
from actionkit._ros.others_goals.goal_board import FIRST, Board, arrived
from actionkit.cli._shared.exits import Exit
from actionkit.cli._shared.no_server import nothing_there
from actionkit.cli._shared.options import HELP, SECONDS, debug_option, json_option, name_argument
from actionkit.cli._shared.problems import full_name, open_survey
from actionkit.cli._shared.say import say
from actionkit.cli.cancel_and_stop._stop_table import exit_of, say_error
from actionkit.cli.watch.watch import NO_STATUS, first_look

if TYPE_CHECKING:
    from actionkit._ros.others_goals.survey import ActionSeen, Survey

_EPILOG = """\b
Examples:
  actionkit cancel /fibonacci
  actionkit cancel /fibonacci 0f1e2d3c-4b5a-6978-8796-a5b4c3d2e1f0
  actionkit cancel /fibonacci --all --timeout 30

The action's own package is not needed. Goals are canceled whoever sent them: other programs are
told that theirs was canceled by somebody else. The exit code is 0 where every goal is known to
run no more, 22 where a server refused, 23 where a goal may still be running, 24 where no server
knows the id, 14 without a server, and 2 where there are goals and neither ID nor --all is given."""


def _goal_id(text: str) -> str:
    try:
        return str(goal_id_of(text))
    except ValueError as error:
        raise click.BadParameter(f"{error}; --all cancels all goals", param_hint="ID") from None


@click.command("cancel", context_settings=HELP, epilog=_EPILOG)
@name_argument
@click.argument("ids", metavar="[ID]...", nargs=-1)
@click.option("-a", "--all", "every", is_flag=True, help="Cancel all goals that run.")
@click.option(
    "--timeout",
    type=SECONDS,
    default=10.0,
    show_default=True,
    help="How long to wait for a goal's end, counted from the latest end of another.",
)
@click.option(
    "--server-timeout",
    type=SECONDS,
    default=5.0,
    show_default=True,
    help="How long to wait for a server.",
)
@click.option(
    "--may-come",
    is_flag=True,
    help="Ask again for goals that no server knows: they were sent, and may be accepted yet.",
)
@json_option("Write one JSON object for each goal.")
@debug_option
def command(
    name: str,
    ids: tuple[str, ...],
    every: bool,
    timeout: float,
    server_timeout: float,
    may_come: bool,
    as_json: bool,
) -> int:
    """Cancel goals of the action NAME, and tell what happened to each.

    ID is the id of a goal, as `actionkit watch`, errors and logs have it. Without ID and --all,
    nothing is canceled: the goals that run are shown.
    """
    if ids and every:
        raise click.UsageError("Give IDs or --all, not both.")
    goal_ids = [_goal_id(text) for text in ids]
    with open_survey() as survey:
        full = full_name(survey, name)
        if not goal_ids and not every:
            return _list(survey, full, server_timeout)
        cancelling = Cancelling(full, goal_ids or None, may_come=may_come)
        try:
            _cancel(survey, cancelling, timeout, server_timeout, partial(_show, full, as_json))
        finally:  # also after Ctrl-C
            if cancelling.has_server:
                for fate in cancelling.settle(time.monotonic(), over=True):
                    _show(full, as_json, fate)
        if not cancelling.has_server:
            code = _no_server(survey, full)
            if survey.may_hide_goals(full):
                text = "Programs that use it are. If its server hangs, GOALS MAY STILL BE RUNNING."
                say(text, err=True)
                code = Exit.CANCEL_UNKNOWN
            return code
    if cancelling.unheard:
        say(cancelling.unheard, err=True)
    elif not cancelling.fates and not as_json:
        say("No goal is running.")
    return exit_of(cancelling)


def _no_server(survey: Survey, name: str) -> Exit:
    say(f"Error: {nothing_there(name, survey.actions())}", err=True)
    return Exit.NO_SERVER


def _list(survey: Survey, name: str, server_timeout: float) -> int:
    from actionkit._ros.others_goals.watch import StatusReader

    def is_served(actions: dict[str, ActionSeen]) -> bool:
        return name in actions and bool(actions[name].servers)

    if not is_served(survey.settled(least=0.0, most=server_timeout, enough=is_served)):
        return _no_server(survey, name)
    board = Board()
    inbox: queue.SimpleQueue[Any] = queue.SimpleQueue()

    def take(timeout: float) -> None:
        for news in arrived(inbox, timeout):
            board.take(news, time.time())

    reader = StatusReader(survey.names(name), on_goals=inbox.put, on_servers=inbox.put)
    try:
        first_look(board, take, server_timeout)
    finally:
        reader.close()
    if not board.servers:
        return _no_server(survey, name)
    running = [goal for goal in board.sorted() if not goal.ended]
    if not running:
        say("No goal is running." if board.has_status else NO_STATUS)
        return Exit.OK
    from actionkit.cli.watch._screens import goal_line

    for goal in running:
        say(goal_line(goal))
    say(
        f"Nothing was canceled. To cancel one: actionkit cancel {name} {running[-1].goal_id}\n"
        f"To cancel all: actionkit cancel {name} --all",
        err=True,
    )
    return Exit.USAGE


def _cancel(
    survey: Survey,
    cancelling: Cancelling,
    timeout: float,
    server_timeout: float,
    show: Callable[[Fate], None],
) -> None:
    """Cancel the goals until it is known what happened to each."""
    began = progressed = time.monotonic()

    def over(now: float) -> bool:
        nonlocal began, progressed
        if not cancelling.has_server or not cancelling.has_looked(now):
            began = progressed = now
            return False
        # Each of many goals has its time; but new goals might come for ever.
        return now - progressed >= timeout or now - began >= timeout + LONGEST_GRACE

    def on_fate(fate: Fate) -> None:
        nonlocal progressed
        progressed = time.monotonic()
        show(fate)

    least = FIRST if cancelling.every else 0.0
    cancel_goals(
        survey,
        [cancelling],
        over=over,
        look=server_timeout,
        least=least,
        on_fate=on_fate,
        on_error=say_error,
    )


def _show(name: str, as_json: bool, fate: Fate) -> None:
    if as_json:
        told = {"goal_id": fate.goal_id, "cancel": fate.cancel, "state": fate.state or None}
        say(note_line("cancel", name, time.time(), **told, detail=fate.text))
    else:
        say(f"{fate.goal_id}  {fate.cancel:<10}  {fate.text}")

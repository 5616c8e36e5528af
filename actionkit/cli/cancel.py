"""`actionkit cancel`: cancel goals of an action, those of other clients too."""

from __future__ import annotations

import queue
import time
import uuid
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

import click

from actionkit._model.settings import LONGEST_GRACE
from actionkit._observers.json_schema import note_line
from actionkit.cli._exits import Exit
from actionkit.cli._options import HELP, SECONDS, debug_option, json_option, name_argument
from actionkit.cli._problems import full_name, open_survey
from actionkit.cli._say import say
from actionkit.cli.watch import FIRST, TICK, first_look

if TYPE_CHECKING:
    from actionkit.cli._cancelling import Cancelling, Fate
    from actionkit.cli._goal_board import Board

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
        goal_id = uuid.UUID(text)
    except ValueError:
        raise click.BadParameter(
            f"{text!r} is no goal id, which has 32 hexadecimal digits, with dashes or without",
            param_hint="ID",
        ) from None
    if not goal_id.int:  # servers understand this as all goals
        raise click.BadParameter("this is no goal's id; --all cancels all goals", param_hint="ID")
    return str(goal_id)


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
@json_option("Write one JSON object for each goal.")
@debug_option
def command(
    name: str,
    ids: tuple[str, ...],
    every: bool,
    timeout: float,
    server_timeout: float,
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

        from actionkit._ros.tools.cancel import GoalCanceller
        from actionkit._ros.tools.watch import StatusReader
        from actionkit.cli._cancelling import Cancelling
        from actionkit.cli._goal_board import Board

        board = Board()
        inbox: queue.SimpleQueue[Any] = queue.SimpleQueue()
        reader = StatusReader(full, on_goals=inbox.put, on_servers=inbox.put)
        canceller = GoalCanceller(full, on_answer=inbox.put)
        try:
            first_look(board, inbox, server_timeout)
            if not board.servers:
                say(f"Error: Action {full!r} has no server in sight.", err=True)
                return Exit.NO_SERVER
            if not goal_ids and not every:
                return _list(full, board)
            cancelling = Cancelling(goal_ids)
            show = partial(_show, full, as_json)
            try:
                _cancel(cancelling, not goal_ids, board, inbox, canceller, timeout, show)
            except KeyboardInterrupt:
                for fate in cancelling.settle(board.goals, time.monotonic(), over=True):
                    show(fate)
                raise
            if not cancelling.fates and not as_json:
                say("No goal is running.")
            return cancelling.exit
        finally:
            canceller.close()
            reader.close()


def _list(name: str, board: Board) -> int:
    running = [goal for goal in board.sorted() if not goal.ended]
    if not running:
        say("No goal is running.")
        return Exit.OK
    from actionkit.cli._watch_screens import goal_line

    for goal in running:
        say(goal_line(goal))
    say(
        f"Nothing was canceled. To cancel one: actionkit cancel {name} {running[-1].goal_id}\n"
        f"To cancel all: actionkit cancel {name} --all",
        err=True,
    )
    return Exit.USAGE


def _cancel(
    cancelling: Cancelling,
    every: bool,
    board: Board,
    inbox: queue.SimpleQueue[Any],
    canceller: Any,
    timeout: float,
    show: Callable[[Fate], None],
) -> None:
    """Cancel the goals (or all running goals), until it is known what happened to each."""
    from actionkit._ros.tools.cancel import CancelSaid

    began = progressed = now = time.monotonic()
    while True:
        if every:
            for goal in board.goals.values():
                if not goal.ended:
                    cancelling.add(goal.goal_id)
        for goal_id in cancelling.to_ask(board.goals):
            canceller.cancel(goal_id)
        # Each of many goals has its time; but new goals might come for ever.
        over = now - progressed >= timeout or now - began >= timeout + LONGEST_GRACE
        for fate in cancelling.settle(board.goals, now, over=over):
            canceller.stop(fate.goal_id)
            show(fate)
            progressed = now
        # A second server on the name may report its goals a little later.
        if cancelling.done and (not every or now - began >= min(FIRST, timeout)):
            return
        try:
            news = inbox.get(timeout=TICK)
        except queue.Empty:
            news = None
        now = time.monotonic()
        if isinstance(news, CancelSaid):
            cancelling.take(news, now)
        elif news is not None:
            board.take(news, time.time())


def _show(name: str, as_json: bool, fate: Fate) -> None:
    if as_json:
        told = {"goal_id": fate.goal_id, "cancel": fate.cancel, "state": fate.state or None}
        say(note_line("cancel", name, time.time(), **told, detail=fate.text))
    else:
        say(f"{fate.goal_id}  {fate.cancel:<10}  {fate.text}")

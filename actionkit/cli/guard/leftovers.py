"""`actionkit leftovers`: show and cancel the goals of processes that were killed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import click

from actionkit._observers.json_schema import note_line
from actionkit.cli._shared.exits import Exit
from actionkit.cli._shared.options import HELP, SECONDS, debug_option, json_option
from actionkit.cli._shared.problems import import_ros
from actionkit.cli._shared.say import say
from actionkit.cli._shared.stdout import keep_clean
from actionkit.cli.guard._leftovers import line_of, open_ledger, what_happened

if TYPE_CHECKING:
    from actionkit import CancelReport, Leftover

_EPILOG = """\b
Examples:
  actionkit leftovers mission.db
  actionkit leftovers mission.db --cancel
  actionkit leftovers mission.db --cancel --forget

PATH is the file of a Ledger; left out, that in the environment variable ACTIONKIT_LEDGER, or the
one that `actionkit guard` and `actionkit mcp` use. The exit code is 0 where no goal is left over,
or every one is known to run no more; 22 where a server refused; 23 where a goal may still be
running."""
_LEAST = 6.0
"""Seconds in which a server that runs is surely seen: `Ledger.cancel` looks for it for 5 s."""
_FORGOTTEN = "Removed from the file: no server of its action is in sight."


@click.command("leftovers", context_settings=HELP, epilog=_EPILOG)
@click.argument("path", metavar="[PATH]", required=False, type=click.Path(exists=True))
@click.option(
    "--cancel",
    "cancels",
    is_flag=True,
    help="Cancel them, and remove those that have stopped, or that no server in sight knows.",
)
@click.option(
    "--forget",
    is_flag=True,
    help="With --cancel: also remove those of actions without a server in sight. They may still"
    " be running.",
)
@click.option(
    "--timeout", type=SECONDS, default=10.0, show_default=True, help="How long that may take."
)
@json_option("Write one JSON object for each goal.")
@debug_option
def command(path: str | None, cancels: bool, forget: bool, timeout: float, as_json: bool) -> int:
    """Show the goals of programs that were killed and wrote them down in the file PATH."""
    from actionkit._internal_api import mute, unfinished_goals

    if forget and not cancels:
        raise click.UsageError("--forget needs --cancel, which looks for the servers")
    if forget and timeout < _LEAST:
        raise click.UsageError(f"--forget needs a --timeout of {_LEAST:g} s: it looks for servers")
    keep_clean()
    ledger = open_ledger(path)
    forgotten: set[Leftover] = set()
    left: Mapping[Leftover, CancelReport | None] = dict.fromkeys(ledger.leftovers())
    if cancels and unfinished_goals(ledger):
        import_ros()
        mute()  # this tells what happened
        left = ledger._cancel(timeout, forgotten=forgotten if forget else None)
    for goal, report in left.items():
        if as_json:
            more = {"goal_id": str(goal.goal_id), "action_type": goal.type_name, "cancel": report}
            who = {"domain_id": goal.domain_id, "process": goal.pid, "host": goal.host}
            who |= {} if goal.key is None else {"key": goal.key}
            say(note_line("leftover", goal.action_name, goal.sent, **more, **who))
        else:
            said = "" if report is None else f"\n  {report}: {what_happened(report)}"
            removed = f"\n  {_FORGOTTEN}" if goal in forgotten else ""
            say(f"{line_of(goal)}{said}{removed}")
    if not left and not as_json:
        say("No goal is left over.")
    reports = {str(report) for report in left.values()}
    if "REFUSED" in reports:
        return Exit.CANCEL_REFUSED
    return Exit.CANCEL_UNKNOWN if reports & {"UNKNOWN", "None"} else Exit.OK

"""`actionkit list`: list the actions in sight."""

from __future__ import annotations

import click

from actionkit._messages.json_text import to_json
from actionkit.cli._shared.exits import Exit
from actionkit.cli._shared.options import HELP, debug_option, json_option, wait_option
from actionkit.cli._shared.problems import open_survey
from actionkit.cli._shared.say import say
from actionkit.cli._shared.versions import not_ours

_MOST = 4.0
"""Seconds to look at most if nothing is seen."""
_EPILOG = """\b
Examples:
  actionkit list
  actionkit list -t
  actionkit list --json"""


@click.command("list", context_settings=HELP, epilog=_EPILOG)
@click.option("-t", "--show-types", is_flag=True, help="Show the action types, too.")
@click.option("-c", "--count-actions", is_flag=True, help="Show only how many there are.")
@wait_option
@json_option("Write one JSON object for each action.")
@debug_option
def command(show_types: bool, count_actions: bool, wait: float, as_json: bool) -> int:
    """List the actions that have a server or a client."""
    with open_survey() as survey:
        seen = survey.settled(least=wait, most=_MOST)
        # A bag player is neither a server nor a client.
        actions = {name: each for name, each in seen.items() if each.servers or each.clients}
        torn = {name for name in actions if any(v.differ for v in survey.versions(name))}
        strange = {name for name, action in actions.items() if not_ours(survey, action)}
    if as_json:
        for action in actions.values():
            say(
                to_json(
                    {
                        "name": action.name,
                        "types": action.types,
                        "servers": [end.node for end in action.servers],
                        "clients": [end.node for end in action.clients],
                        "versions_differ": action.name in torn,
                        "differs_from_here": action.name in strange,
                    }
                )
            )
    elif count_actions:
        say(str(len(actions)))
    else:
        for action in actions.values():
            types = f" [{', '.join(action.types)}]" if show_types else ""
            warning = ""
            if action.name in torn:
                warning = " (in two versions: see `actionkit info`)"
            elif action.name in strange:
                warning = " (another version is installed here: see `actionkit info`)"
            say(f"{action.name}{types}{warning}")
    return Exit.OK

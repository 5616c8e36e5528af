"""`actionkit info`: show the nodes on an action."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from actionkit._messages.json_text import to_json
from actionkit.cli._shared.exits import Exit
from actionkit.cli._shared.no_server import nothing_there
from actionkit.cli._shared.options import (
    HELP,
    debug_option,
    json_option,
    name_argument,
    wait_option,
)
from actionkit.cli._shared.problems import full_name, open_survey
from actionkit.cli._shared.say import say
from actionkit.cli._shared.versions import not_ours

if TYPE_CHECKING:
    from actionkit._ros.endpoints.graph import Endpoint

_EPILOG = """\b
Examples:
  actionkit info /fibonacci -t
  actionkit info /fibonacci --json

The exit code is 14 where the action has no server in sight."""


@click.command("info", context_settings=HELP, epilog=_EPILOG)
@name_argument
@click.option("-t", "--show-types", is_flag=True, help="Show the action types, too.")
@click.option("-c", "--count", is_flag=True, help="Show only how many there are.")
@wait_option
@json_option("Write one JSON object.")
@debug_option
def command(name: str, show_types: bool, count: bool, wait: float, as_json: bool) -> int:
    """Show the clients and servers of the action NAME."""
    with open_survey() as survey:
        full = full_name(survey, name)
        actions = survey.settled(
            least=wait,
            enough=lambda seen: full in seen and bool(seen[full].servers),
        )
        versions = [each for each in survey.versions(full) if each.servers or each.clients]
        action = actions.get(full)
        different = not_ours(survey, action) if action else ""
    servers = action.servers if action else ()
    clients = action.clients if action else ()
    if as_json:
        say(
            to_json(
                {
                    "name": full,
                    "clients": [{"node": e.node, "type": e.action_type} for e in clients],
                    "servers": [{"node": e.node, "type": e.action_type} for e in servers],
                    "type_hashes": {
                        each.end: {"servers": each.servers, "clients": each.clients}
                        for each in versions
                    },
                    "differs_from_here": bool(different),
                }
            )
        )
    else:
        say(f"Action: {full}")
        _show("clients", clients, count, show_types)
        _show("servers", servers, count, show_types)
        for each in versions:
            if each.differ:
                say(f"Two versions of the {each}")
        if different:
            say(f"Another version is installed here: {different}")
    if not servers:
        say(f"Error: {nothing_there(full, actions)}", err=True)
        return Exit.NO_SERVER
    return Exit.OK


def _show(what: str, ends: tuple[Endpoint, ...], count: bool, show_types: bool) -> None:
    say(f"Action {what}: {len(ends)}")
    if not count:
        for end in ends:
            kind = f" [{end.action_type}]" if show_types else ""
            say(f"    {end.node or '(a node not known yet)'}{kind}")

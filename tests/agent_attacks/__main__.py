"""The command `python -m tests.agent_attacks`: a few hundred attacks on the tools of an agent.

Each group attacks `Toolbox` or `actionkit mcp`, in processes of their own, with real action
servers over DDS. An attack passes if a goal outside of its limits is sent, or one that no human has
approved, or any while a human holds the robot; if too many goals run, or one that nobody names; if
a result is wrong, leaks what it must not, or has what only a model sees; if something hangs or
dies; if somebody comes in over HTTP. Each that passes is printed, and makes the exit code 1.
"""

from __future__ import annotations

import asyncio
import os
import sys
import tempfile
import time
import traceback
from collections.abc import AsyncIterator, Callable
from pathlib import Path

import click

from tests.agent_attacks import approval, arguments, places, stops, web
from tests.agents.over_mcp.lab import robot as make_robot

GROUPS: dict[str, Callable[[places.Place], AsyncIterator[tuple[str, str]]]] = {
    "arguments": arguments.attacks,
    "approval": approval.attacks,
    "stops": stops.attacks,
    "HTTP": web.attacks,
}


async def run(name: str, folder: Path) -> tuple[int, int]:
    """Run a group; return the number of its attacks, and of those that passed."""
    number = passed = 0
    with make_robot(folder) as robot:
        place = places.Place(robot)
        try:
            async for attack, wrong in GROUPS[name](place):
                number += 1
                if wrong:
                    passed += 1
                    click.echo(f"PASSED {name} {number}: {attack}: {wrong}")
        except Exception:  # noqa: BLE001  what could not be attacked has not been held
            passed += 1
            click.echo(f"PASSED {name} {number + 1}: the group ended:\n{traceback.format_exc()}")
    return number, passed


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.option("--only", multiple=True, type=click.Choice(list(GROUPS)))
@click.option(
    "--cache",
    type=click.Path(file_okay=False, path_type=Path),
    default=Path.home() / ".cache" / "actionkit-attacks",
    show_default=True,
    help="Where the action type that is attacked is built, once.",
)
def main(only: tuple[str, ...], cache: Path) -> None:
    """Run all attacks, or some groups of them; list those that passed."""
    places.build(cache)
    rows = []
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    for name in only or GROUPS:
        with tempfile.TemporaryDirectory() as folder:
            os.environ["ACTIONKIT_HOLD_DIR"] = f"{folder}/holds"
            began = time.monotonic()
            number, passed = asyncio.run(run(name, Path(folder)))
            rows.append(f"| {name} | {number} | {passed} | {time.monotonic() - began:.0f} s |")
    click.echo("\n".join(["| group | attacks | passed | took |", "|---|---|---|---|", *rows]))
    sys.exit(any(row.split("|")[3].strip() != "0" for row in rows))


if __name__ == "__main__":
    main()

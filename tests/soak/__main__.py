"""The command `python -m tests.soak`: everything at once, for any time.

Threads, asyncio tasks, deadlines, cancels, retries and judges, against servers that are killed,
stopped, restarted, doubled and replaced, or that block, over networks that lose packets, by
programs that are told to end, and by children of `multiprocessing`. What callers are told is
compared with what the servers' own journals show. The exit code is 0 only where nothing was left
running and nothing was wrong.
"""

from __future__ import annotations

import faulthandler
import random
import signal
import sys
import tempfile
import time
from pathlib import Path

import click

from tests.faults import attacks, network
from tests.faults.page import PAGE
from tests.soak import plan
from tests.soak.place import Place, places
from tests.soak.processes import Worker
from tests.soak.report import Totals
from tests.soak.rounds import Result, Round
from tests.tables import Seconds

_ROOT = Path(__file__).parents[2]
_STUCK = 300.0
"""Seconds beyond a round's calls after which the soak itself is stuck."""


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.option("--minutes", type=float, default=60.0, show_default=True, help="How long it goes on.")
@click.option("--seed", type=int, help="Of all that is left to chance; by default a new one.")
@click.option("--round", "seconds", type=float, default=25.0, show_default=True)
@click.option(
    "--first", type=int, default=0, help="The number of the first round, to see one again."
)
@click.option("--no-network", is_flag=True, help="On this machine alone; else that needs root.")
@click.option(
    "--out",
    type=click.Path(dir_okay=False, path_type=Path),
    default=_ROOT / "build" / "soak.json",
    help="Where the report goes.",
)
@click.option(
    "--write-docs",
    is_flag=True,
    help="Put a good result of an hour into docs/maintainers/faults.md.",
)
def main(
    minutes: float,
    seed: int | None,
    seconds: float,
    first: int,
    no_network: bool,
    out: Path,
    write_docs: bool,
) -> None:
    """Try to make ActionKit break its promises, and count what is broken."""
    if write_docs and f"{minutes:g} minutes" != attacks.SOAK_TIME:
        raise click.UsageError(f"docs/maintainers/faults.md tells of {attacks.SOAK_TIME}")
    totals = Totals(random.randrange(10_000) if seed is None else seed)
    # A shell ignores it in the background, and so would the programs that are told by Ctrl-C.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    problem = "asked for" if no_network else _why_no_network()
    click.echo(f"seed {totals.seed}" + (f"; no network: {problem}" if problem else ""))
    began = told = time.monotonic()
    with tempfile.TemporaryDirectory() as directory, places(with_network=not problem) as found:
        workers: dict[str, Worker] = {}
        while totals.rounds == 0 or time.monotonic() < began + 60 * minutes:
            number = first + totals.rounds
            place = found[number % len(found)]
            left = began + 60 * minutes - time.monotonic()
            length = min(seconds, max(10.0, left))
            todo = plan.make(totals.seed, number, length, with_network=place.cable is not None)
            totals.add(number, _round(todo, place, workers, Path(directory) / str(number)))
            totals.seconds = time.monotonic() - began
            if time.monotonic() > told + 55:
                told = time.monotonic()
                click.echo(totals.line)
            totals.write(out)  # each time, so that what goes wrong later loses nothing
        for name, worker in workers.items():
            if not worker.stop(30):
                totals.problems["hung"] += 1
                totals.texts.setdefault("hung", []).append(f"{name}: its clients did not close")
    totals.write(out)
    click.echo(totals.text)
    if write_docs and totals.good:
        _write_docs(totals)
    sys.exit(0 if totals.good else 1)


def _why_no_network() -> str:
    if problem := network.why_not():
        return problem
    with network.two_hosts() as hosts:
        return network.why_nothing_can_be_lost(hosts)


def _round(todo: plan.Plan, place: Place, workers: dict[str, Worker], directory: Path) -> Result:
    faulthandler.dump_traceback_later(todo.seconds + _STUCK, exit=True)
    place.enter()
    if place.name not in workers:
        workers[place.name] = Worker(place)
    directory.mkdir()
    result = Round(place, workers[place.name], todo, directory).run()
    if not result.state:
        # It hangs: what it knows is in the report, and another takes its place.
        workers.pop(place.name).stop(0)
    faulthandler.cancel_dump_traceback_later()
    return result


def _write_docs(totals: Totals) -> None:
    cells = (attacks.calls(totals.calls), Seconds(max(0.0, totals.late)))
    PAGE.write(attacks.SOAK, {(attacks.SOAK_TIME,): cells})


if __name__ == "__main__":
    main()

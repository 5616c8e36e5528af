"""The command `python -m tests.mutants`: would the tests notice if ActionKit were wrong?

Each mutant is one line made wrong, in a copy of the checkout. One of its tests must fail.
"""

from __future__ import annotations

import importlib
import pkgutil
import sys
import tempfile
import time
from pathlib import Path

import click

from tests.mutants import promises, slots
from tests.mutants.mutant import Mutant


def all_mutants() -> list[Mutant]:
    """Return the mutants of all promises, sorted by promise."""
    modules = [
        importlib.import_module(f"{promises.__name__}.{module.name}")
        for module in pkgutil.iter_modules(promises.__path__)
    ]
    mutants = [mutant for module in modules for mutant in module.MUTANTS]
    return sorted(mutants, key=lambda mutant: [int(part) for part in mutant.promise[1:].split(".")])


def _is_meant(mutant: Mutant, words: tuple[str, ...]) -> bool:
    return any(word == mutant.promise or word in f"{mutant.path}: {mutant.wrong}" for word in words)


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.argument("only", nargs=-1)
@click.option(
    "--at-once", default=4, show_default=True, help="How many mutants are tested at once."
)
def main(only: tuple[str, ...], at_once: int) -> None:
    """Make each mutant, and see that its tests fail.

    ONLY is any number of promises, or of words of a file's name or of what is wrong.
    """
    mutants = [mutant for mutant in all_mutants() if not only or _is_meant(mutant, only)]
    if not mutants:
        raise click.UsageError(f"no mutant has one of {', '.join(only)}")
    if problems := [why for mutant in mutants if (why := mutant.problem(slots.ROOT))]:
        raise click.ClickException("\n".join(problems))
    began = time.monotonic()
    runs = []
    with tempfile.TemporaryDirectory(prefix="actionkit-mutants.") as folder:
        for run in slots.run(mutants, Path(folder), at_once):
            if run.mutant is not None:
                runs.append(run)
                click.echo("." if run.noticed else "M", nl=False)
            elif run.code != 0:
                raise click.ClickException(f"{run.output}\nThese fail with nothing changed")
    click.echo()
    for run in sorted(runs, key=lambda run: mutants.index(run.mutant)):
        click.echo(
            f"{run.mutant.promise:6} {run.seconds:5.1f} s  {run.mutant.wrong}\n"
            f"{'':16}{run.mutant.path}, {'noticed by' if run.noticed else 'MISSED by'} {run.why}"
        )
    missed = sum(not run.noticed for run in runs)
    long = sum(run.mutant.long for run in runs)
    click.echo(
        f"{len(runs)} mutants, {long} of them for a long test, {missed} missed,"
        f" in {time.monotonic() - began:.0f} s"
    )
    sys.exit(1 if missed else 0)


if __name__ == "__main__":
    main()

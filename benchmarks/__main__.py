"""The command `python -m benchmarks`."""

from __future__ import annotations

import importlib
import sys
import time
from pathlib import Path

import click

_ROOT = Path(__file__).parent.parent
_MODULES = {
    1: "b1_calls",
    2: "b2_remembered",
    3: "b3_in_flight",
    4: "b4_traffic",
    5: "b5_idle",
    6: "b6_soak",
    7: "b7_trees",
    8: "b8_fresh",
    9: "b9_scale",
    10: "b10_watch",
    11: "b11_recordings",
}
_SHOWN = Path(__file__).parent / "results.json"
"""What the page shows. It is kept with the code, so that one part can be measured anew alone."""


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.option("--quick", is_flag=True, help="Fewer rounds and calls: all in ten minutes.")
@click.option(
    "--only",
    type=click.Choice([str(n) for n in _MODULES]),
    multiple=True,
    help="One, or some; the others' results stay.",
)
@click.option(
    "--out",
    type=click.Path(file_okay=False, path_type=Path),
    default=_ROOT / "build" / "benchmarks",
    help="Where results.json and the pictures go.",
)
@click.option(
    "--write-docs",
    is_flag=True,
    help="Put what is measured into docs/cost.md, its pictures and benchmarks/figures.md.",
)
def main(quick: bool, only: tuple[str, ...], out: Path, write_docs: bool) -> None:
    """Measure what ActionKit costs, in alternation with hand-written rclpy clients."""
    try:
        from benchmarks import plot, report
        from benchmarks.measure import Scale, console
    except ImportError as error:
        raise click.ClickException(f"{error}; pip install -e '.[bench]'") from error
    scale = Scale(quick)
    command = " ".join(["python -m benchmarks", *sys.argv[1:]])
    out.mkdir(parents=True, exist_ok=True)
    # What was not measured anew stays as it was.
    known = report.read_json(out / "results.json") if only else {}
    for number in sorted(int(n) for n in only) or _MODULES:
        began = time.monotonic()
        module = importlib.import_module(f"benchmarks.{_MODULES[number]}")
        known[number] = module.run_all(scale)
        known[number].about = report.about(command)
        report.show(known[number])
        console.print(f"  {time.monotonic() - began:.0f} s", style="dim")
        # Each time, so that what goes wrong later loses nothing.
        report.write_json(known, out / "results.json")
        plot.write(known, out)
        if write_docs:
            shown = {**report.read_json(_SHOWN), number: known[number]}
            report.write_json(shown, _SHOWN)
            for page in ("docs/cost.md", "benchmarks/figures.md"):
                report.write_docs(shown, _ROOT / page)
            plot.write(shown, _ROOT / "docs")
    missed = [
        verdict.target for one in known.values() for verdict in one.verdicts if not verdict.met
    ]
    click.echo(f"{len(missed)} targets missed" + "".join(f"\n- {target}" for target in missed))


if __name__ == "__main__":
    main()

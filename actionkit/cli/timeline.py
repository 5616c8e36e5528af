"""`actionkit timeline`: show a log of `JsonLines` as text or as a picture."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from actionkit._model.timeline import Recorder
from actionkit._observers.json_reader import read_json_lines
from actionkit._observers.json_schema import LoggedLine
from actionkit.cli._shared.exits import Exit
from actionkit.cli._shared.options import HELP, debug_option
from actionkit.cli._shared.problems import Problem
from actionkit.cli._shared.say import say

_SHOWN = 10
"""Unreadable lines that are reported; more of them would not help."""
_EPILOG = """\b
Examples:
  actionkit timeline goals.jsonl
  actionkit timeline goals.jsonl --last 3 --svg goals.svg
  actionkit call /fibonacci test_msgs/action/Fibonacci '{order: 5}' --json > one.jsonl
  actionkit timeline one.jsonl"""


@click.command("timeline", context_settings=HELP, epilog=_EPILOG)
@click.argument("file", type=click.Path(path_type=Path))
@click.option(
    "--svg",
    type=click.Path(dir_okay=False, path_type=Path, allow_dash=True),
    metavar="OUT",
    help="Draw the goals, too, into this file; '-' for the standard output, without the text.",
)
@click.option(
    "--last",
    type=click.IntRange(min=1),
    metavar="N",
    help="Only the N calls that began last.",
)
@debug_option
def command(file: Path, svg: Path | None, last: int | None) -> int:
    """Show the goals in FILE, a log of the observer JsonLines.

    Files that it set aside (FILE.1, FILE.2, ...) are read, too. So is what the commands `call` and
    `watch` write with --json.
    """
    try:
        log = read_json_lines(file)
    except OSError as error:
        raise click.BadParameter(f"{file}: {error.strerror or error}", param_hint="FILE") from error
    if log.problems and not log.lines:
        raise Problem(
            Exit.FAILED,
            f"{file} is no log of goals: of its {len(log.problems)} lines none could be read. The"
            f" first is {log.problems[0]}.",
        )
    for problem in log.problems[:_SHOWN]:
        say(f"not read: {problem}", err=True)
    if len(log.problems) > _SHOWN:
        say(f"not read: {len(log.problems) - _SHOWN} lines more", err=True)
    calls = list(log.calls().values())[-(last or 0) :]
    if not calls:
        say(f"{file}: there are no goals in it", err=True)
        return Exit.FAILED
    to_stdout = svg is not None and str(svg) == "-"
    if not to_stdout:
        say(report(calls))
    if svg is not None:
        _draw(calls, file, None if to_stdout else svg)
    return Exit.OK


def _draw(calls: list[list[LoggedLine]], file: Path, out: Path | None) -> None:
    from actionkit._pictures.svg import draw

    picture = draw(calls, name=file.name)
    if out is None:
        sys.stdout.write(picture)
        return
    try:
        out.write_text(picture, "utf-8")
    except OSError as error:
        raise click.ClickException(f"{out}: {error.strerror or error}") from error


def report(calls: list[list[LoggedLine]]) -> str:
    """Return the timelines of calls, each with its end."""
    return "\n\n".join(_call_text(lines) for lines in calls)


def _call_text(lines: list[LoggedLine]) -> str:
    recorder = Recorder()
    for line in lines:
        if line.event is not None:
            recorder.add(line.event)
    node = f", node {lines[0].node_name}" if lines[0].node_name else ""
    head = f"{lines[0].action_name} ({lines[0].action_type}{node}, process {lines[0].pid})"
    parts = [head, str(recorder.events())] if recorder.events() else [head]
    ends = [line.data for line in lines if line.kind == "outcome"]
    if not ends:
        last = recorder.events()[-1] if recorder.events() else None
        ended = f"goal {last.state}; " if last is not None and last.state.is_terminal else ""
        parts.append(f"=> {ended}no end of the call in this log")
    for end in ends:
        said = f"=> {end['outcome']} after {end['elapsed_ms']:.1f} ms"
        parts.append(f"{said}: {end['error']}" if end["error"] else said)
    return "\n".join(parts)

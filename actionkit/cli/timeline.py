"""`actionkit timeline`: show a log of `JsonLines`, or a recording, as text or as a picture."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from contextlib import suppress
from datetime import datetime, time, timezone
from pathlib import Path

import click

from actionkit._messages.json_text import to_json
from actionkit._model.settings import MOST
from actionkit._model.values import GoalState
from actionkit._observers.json_reader import ending, timeline_of
from actionkit._observers.json_schema import LoggedLine
from actionkit._recordings.goals import read
from actionkit.cli._shared.exits import Exit
from actionkit.cli._shared.options import HELP, debug_option, json_option
from actionkit.cli._shared.problems import Problem
from actionkit.cli._shared.say import say

_SHOWN = 10
"""Problems that are reported; more of them would not help."""
_EPILOG = """\b
Examples:
  actionkit timeline goals.jsonl
  actionkit timeline goals.jsonl --last 3 --svg goals.svg
  actionkit timeline rosbag2_2026_11_30-02_00_00 --from 02:10 --to 02:15 --svg night.svg
  actionkit timeline arm.mcap --action /move_arm

--from and --to are a time as in the timeline, in UTC, such as 02:10 or 2026-11-30T02:10:05; or
seconds after the first goal's beginning, such as 90. For recordings, `pip install mcap rosbags`; no
ROS is needed."""

_HALF_DAY = 12 * 3600.0
_Moment = Callable[[float], float]
"""Turns the time at which the first goal began into another; seconds since the epoch."""


def TIME(value: str) -> _Moment:
    """Return the moment that a text means. Help texts show the name of this function."""
    with suppress(ValueError):
        seconds = float(value)
        if 0 <= seconds <= MOST:
            return lambda began: began + seconds
    with suppress(ValueError):
        clock = time.fromisoformat(value)
        return lambda began: _next(clock, began)
    with suppress(ValueError):
        date = _utc(datetime.fromisoformat(value.removesuffix(" UTC")))
        return lambda began: date.timestamp()
    raise click.BadParameter(
        f"{value!r} is no time: give seconds, such as 90, or a time in UTC, such as 02:10, 02:10:05"
        " or 2026-11-30T02:10:05"
    )


def _next(clock: time, began: float) -> float:
    """Return when a clock shows this time, from half a day before `began` to half a day after."""
    day = datetime.fromtimestamp(began, timezone.utc).date()
    ahead = _utc(datetime.combine(day, clock)).timestamp() - began
    return began + (ahead + _HALF_DAY) % (2 * _HALF_DAY) - _HALF_DAY


def _utc(date: datetime) -> datetime:
    return date if date.tzinfo else date.replace(tzinfo=timezone.utc)


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
@click.option("--action", "actions", multiple=True, metavar="NAME", help="Only this action's.")
@click.option("--from", "since", type=TIME, help="Only what had not ended at this time.")
@click.option("--to", "until", type=TIME, help="Only what had begun at this time.")
@json_option("Write the events as JSON lines, as JsonLines does, instead of the text.")
@debug_option
def command(
    file: Path,
    svg: Path | None,
    last: int | None,
    actions: tuple[str, ...],
    since: _Moment | None,
    until: _Moment | None,
    as_json: bool,
) -> int:
    """Show the goals in FILE, a log of the observer JsonLines or a recording of `ros2 bag`.

    Of a log, the files that it set aside (FILE.1, FILE.2, ...) are read, too. So is what the
    commands `call` and `watch` write with --json. A recording is its folder, or an .mcap or .db3
    file: it has the goals of all clients.
    """
    try:
        recording = read(file)
    except OSError as error:
        raise click.BadParameter(f"{file}: {error.strerror or error}", param_hint="FILE") from error
    except (ValueError, ImportError) as error:
        raise Problem(Exit.FAILED, str(error)) from error
    for problem in recording.problems[:_SHOWN]:
        say(problem, err=True)
    if len(recording.problems) > _SHOWN:
        say(f"not read: {len(recording.problems) - _SHOWN} lines more", err=True)
    calls = _chosen(recording.calls, actions, since, until)[-(last or 0) :]
    if not calls:
        names = sorted({lines[0].action_name for lines in recording.calls})
        what = f"no such goals in it, but goals of {', '.join(names)}"
        say(f"{file}: there are {what if names else 'no goals in it'}", err=True)
        return Exit.FAILED
    to_stdout = svg is not None and str(svg) == "-"
    if as_json and not to_stdout:
        lines = (line for each in calls for line in each)
        for line in sorted(lines, key=lambda line: float(line.data["wall"])):
            say(to_json(dict(line.data), compact_ascii=True))
    elif not to_stdout:
        say(report(calls))
    if svg is not None:
        _draw(calls, file, None if to_stdout else svg)
    return Exit.OK


def _chosen(
    calls: list[list[LoggedLine]],
    actions: tuple[str, ...],
    since: _Moment | None,
    until: _Moment | None,
) -> list[list[LoggedLine]]:
    """Return the calls of these actions that were not over at `since`, and had begun at `until`."""
    began = min((_wall(lines[0]) for lines in calls), default=0.0)
    first = since(began) if since else -math.inf
    last = until(began) if until else math.inf
    names = {f"/{name.lstrip('/')}" for name in actions}
    return [
        lines
        for lines in calls
        if (not names or lines[0].action_name in names)
        and _wall(lines[0]) <= last
        and (ending(lines) is None or _wall(lines[-1]) >= first)
    ]


def _wall(line: LoggedLine) -> float:
    return float(line.data["wall"])


def _draw(calls: list[list[LoggedLine]], file: Path, out: Path | None) -> None:
    from actionkit._recordings.pictures.svg import draw

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
    events = timeline_of(line.event for line in lines)
    parts = [_head(lines), *([str(events)] if events else ())]
    end = ending(lines)
    outcomes = [line.data for line in lines if line.kind == "outcome"]
    for outcome in outcomes:
        said = f"=> {outcome['outcome']} after {outcome['elapsed_ms']:.1f} ms"
        parts.append(f"{said}: {outcome['error']}" if outcome["error"] else said)
    if not outcomes and end is not None:
        took = (end[1] - lines[0].data["monotonic"]) * 1000
        parts.append(f"=> {end[0]} after {took:.1f} ms" if took else f"=> {end[0]}")
    elif not outcomes:
        states = [event.state for event in events if event.state is not GoalState.FEEDBACK]
        whose = "goal" if states and states[0] is not GoalState.SENDING else "call"
        ended = f"goal {states[-1]}; " if whose == "goal" or states[-1].is_terminal else ""
        parts.append(f"=> {ended}no end of the {whose} in this log")
    return "\n".join(parts)


def _head(lines: list[LoggedLine]) -> str:
    first = lines[0]
    who = [first.action_type] if first.action_type else []
    if first.node_name:
        who.append(f"node {first.node_name}")
    if first.pid:
        who.append(f"process {first.pid}")
    if sent_by := next((line.data["sent_by"] for line in lines if "sent_by" in line.data), None):
        who.append(f"sent by {sent_by}")
    if "server" in first.data:
        who.append(f"server {first.data['server']}")
    return f"{first.action_name} ({', '.join(who)})" if who else first.action_name

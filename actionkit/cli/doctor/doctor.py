"""`actionkit doctor`: find out why a call does not work."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator

import click

from actionkit._messages.json_text import to_json
from actionkit.cli._shared.exits import Exit
from actionkit.cli._shared.options import (
    HELP,
    complete_names,
    debug_option,
    json_option,
    wait_option,
)
from actionkit.cli._shared.problems import Problem, full_name, open_survey
from actionkit.cli._shared.say import say, wrapped
from actionkit.cli.doctor._findings import Finding, problem
from actionkit.cli.doctor._machine import machine, shared_memory
from actionkit.cli.doctor._settings import settings

_STYLES = {"ok": "green", "note": "yellow", "problem": "red"}
_EPILOG = """\b
Examples:
  actionkit doctor
  actionkit doctor /fibonacci
  actionkit doctor /fibonacci --json

With NAME, the time until its server is seen, is matched and answers is measured. What is asked
is to cancel a goal that nobody knows, which does nothing. The exit code is 0 where no problem
was found, 1 where one was, 3 where rclpy cannot be imported."""


@click.command("doctor", context_settings=HELP, epilog=_EPILOG)
@click.argument("name", metavar="[NAME]", required=False, shell_complete=complete_names)
@wait_option
@json_option("Write one JSON object for each finding.")
@debug_option
def command(name: str | None, wait: float, as_json: bool) -> int:
    """Find out why a call does not work, and say what to do about it."""
    worst = Exit.OK
    count = 0
    for finding in _findings(name, wait):
        _show(finding, as_json)
        if finding.level == "problem":
            count += 1
            worst = Exit.NO_ROS if finding.topic == "rclpy" else worst or Exit.FAILED
    if not as_json:
        words = "No problem was found." if count == 0 else f"Problems found: {count}."
        say(f"\n{words}")
    return worst


def _findings(name: str | None, wait: float) -> Iterator[Finding]:
    broken = False
    for finding in machine():
        yield finding
        broken = broken or finding.level == "problem"
    for finding in shared_memory():
        yield finding
        broken = True
    for finding in settings(os.environ):
        yield finding
        broken = broken or (finding.level == "problem" and finding.topic == "ROS_DOMAIN_ID")
    if broken:
        return
    try:
        survey = open_survey()
    except Problem as error:
        yield problem(
            "graph", error.message, "See the settings above; --debug shows where it comes from."
        )
        return
    from actionkit.cli.doctor._graph import actions_in_sight

    with survey:
        yield from actions_in_sight(survey, None if name is None else full_name(survey, name), wait)


def _show(finding: Finding, as_json: bool) -> None:
    if as_json:
        record = {"level": finding.level, "topic": finding.topic, "text": finding.text}
        say(to_json({**record, "remedy": finding.remedy or None}))
        sys.stdout.flush()
        return
    label = click.style(f"{finding.level:<7}", fg=_STYLES[finding.level])
    say(wrapped(f"{finding.topic}: {finding.text}", 8), label=f"{label} ")
    if finding.remedy:
        say(f"          -> {wrapped(finding.remedy, 13)}")
    sys.stdout.flush()

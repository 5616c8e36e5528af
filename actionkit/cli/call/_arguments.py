"""Finds NAME, TYPE and GOAL of `actionkit call`. TYPE is optional; people swap NAME and TYPE."""

from __future__ import annotations

import re
import shlex
from typing import TYPE_CHECKING, Any

import click

from actionkit._messages.by_name import BrokenPackageError, installed, interface_class
from actionkit.cli._shared.exits import Exit
from actionkit.cli._shared.no_server import nothing_there
from actionkit.cli._shared.problems import Problem, full_name

if TYPE_CHECKING:
    from actionkit._ros.others_goals.survey import Survey

_TYPE = re.compile(r"[A-Za-z]\w*/action/[A-Za-z]\w*")
_NAME = re.compile(r"[\w/.-]+")
"""Matches a type, also a wrong one, but not a goal, which has braces, a colon or a space."""

_SEEN_WITHIN = 3.0
"""Seconds until a server is seen, also if the first announcement of it was lost."""


def told_apart(
    name: str, type_name: str | None, words: tuple[str, ...], stdin: bool
) -> tuple[str | None, str | None]:
    """Return TYPE and GOAL, each `None` if it was left out.

    The arguments are in the user's order: if TYPE was left out, `type_name` is GOAL. `words` are
    what follows; more than one if GOAL was not put in quotes. `stdin` means that the goal comes by
    `--stdin`.

    Raises:
        click.UsageError: NAME and TYPE are swapped, NAME is missing, TYPE and GOAL are, or GOAL is
            more than one word.
    """
    if type_name is not None and not _NAME.fullmatch(type_name):
        words, type_name = (type_name, *words), None
    if len(words) > 1:
        raise click.UsageError(_several(name, type_name, words))
    goal = words[0] if words else None
    if stdin and goal is not None:
        raise click.UsageError("Give the goal as GOAL or by --stdin, not both.")
    source = ["--stdin"] if stdin else [] if goal is None else [goal]
    if _is_type(name) and not _is_type(type_name or ""):
        wrong = "NAME is missing" if type_name is None else "NAME and TYPE are swapped"
        right = shlex.join(["actionkit", "call", type_name or "NAME", name, *source])
        raise click.UsageError(f"{wrong}: {name} is an action type. Write: {right}")
    if type_name is None and not source:
        right = shlex.join(["actionkit", "call", name, "{}"])
        raise click.UsageError(f"GOAL is missing. {{}} is a goal with all defaults: {right}")
    return type_name, goal


def _several(name: str, type_name: str | None, words: tuple[str, ...]) -> str:
    """Return the error for a goal that the shell has split, or for words behind a whole one."""
    if words[0].endswith("}"):
        return f"What is {' '.join(words[1:])!r} behind GOAL? An option begins with two dashes."
    named = [name] if type_name is None else [name, type_name]
    right = shlex.join(["actionkit", "call", *named, " ".join(words)])
    return f"GOAL has {len(words)} words, because it is not in quotes. Write: {right}"


def action_class(text: str) -> Any:
    """Return the class of an action type; `test_msgs/Fibonacci` is enough as its name.

    Raises:
        click.BadParameter: There is no such type; the text names the most similar ones.
        Problem: The package exists, but cannot be imported.
    """
    try:
        return interface_class(_whole(text), "action")
    except BrokenPackageError as error:
        raise Problem(Exit.NO_ROS, str(error)) from error
    except ValueError as error:
        raise click.BadParameter(str(error), param_hint="TYPE") from error


def _is_type(text: str) -> bool:
    """Whether this is the name of an action type, and not of an action."""
    return _TYPE.fullmatch(text) is not None or _whole(text) in installed()


def _whole(text: str) -> str:
    """Return `test_msgs/action/Fibonacci` for `test_msgs/Fibonacci`; other texts as they are."""
    package, slash, name = text.partition("/")
    return f"{package}/action/{name}" if slash and "/" not in name else text


def served_type(survey: Survey, name: str, patience: float, limit: str) -> str:
    """Return the type that the servers of an action have; wait `patience` seconds for a server.

    `limit` is the option that sets `patience`.

    Raises:
        Problem: There is no server.
        click.BadParameter: The name is not valid, or the servers have several types, which the text
            lists.
    """
    full = full_name(survey, name)
    seen = survey.settled(
        least=0.0,
        most=patience,
        enough=lambda actions: full in actions and bool(actions[full].servers),
    )
    if full not in seen or not seen[full].servers:
        late = f" A server that runs can take {_SEEN_WITHIN:g} s to be seen."
        raise Problem(
            Exit.NO_SERVER,
            f"{nothing_there(full, seen)} So its type is not known, and nothing was sent."
            f"{late if patience < _SEEN_WITHIN else ''} To wait longer, use {limit}.",
        )
    first, *others = seen[full].types
    if others:
        raise click.BadParameter(
            f"{full} is served with several types, {' and '.join([first, *others])}. Say which one"
            " you mean. Nothing was sent.",
            param_hint="TYPE",
        )
    return first

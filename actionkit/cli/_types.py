"""Finds the class of an action type by its name, and the installed types."""

from __future__ import annotations

import importlib
import importlib.util
import re
import sys
from functools import cache
from pathlib import Path
from typing import Any

import click

from actionkit._model.ros_packages import repository, wheel
from actionkit._model.similar_names import similar_names
from actionkit.cli._exits import Exit
from actionkit.cli._problems import Problem

_TYPE = re.compile(r"([A-Za-z]\w*)/(?:action/)?([A-Za-z]\w*)")
_PART = re.compile(r"_(SendGoal|GetResult)(_Request|_Response|_Event)?$")


@cache
def installed() -> tuple[str, ...]:
    """Return the names of all action types that can be imported, sorted."""
    found: set[str] = set()
    for entry in sys.path:
        for init in Path(entry or ".").glob("*/action/__init__.py"):
            package = init.parts[-3]
            # The form of rosidl's code, so that nothing must be imported.
            line = re.compile(rf"^from {re.escape(package)}\.action\._\w+ import (\w+)", re.M)
            try:
                names = line.findall(init.read_text("utf-8"))
            except (OSError, UnicodeDecodeError):
                continue
            found.update(f"{package}/action/{name}" for name in names if not _PART.search(name))
    return tuple(sorted(found))


def is_type(text: str) -> bool:
    """Whether this is the name of an action type, and not of an action."""
    match = _TYPE.fullmatch(text)
    return match is not None and (
        "/action/" in text or "/action/".join(match.groups()) in installed()
    )


def load(text: str) -> Any:
    """Return the class of an action type; `test_msgs/Fibonacci` is enough as its name.

    Raises:
        click.BadParameter: There is no such type; the text names the most similar ones.
        Problem: The package exists, but cannot be imported.
    """
    match = _TYPE.fullmatch(text)
    if match is None:
        raise _bad(
            f"{text!r} is no action type: one is written as test_msgs/action/Fibonacci.", text
        )
    package, name = match.groups()
    if importlib.util.find_spec(package) is None:
        if (wanted := wheel(package)) is not None:
            how = f"Install it: `pip install {wanted}`, or `sudo apt install {wanted}`"
        else:
            address = repository(package)
            where = "" if address is None else f" ({address})"
            how = f"Or build it from its source{where} with `actionkit interfaces build`"
        raise _bad(
            f"the package {package!r} is not installed here. If it is in a workspace of yours,"
            f" source that: `source install/setup.bash`. {how}.",
            text,
        )
    try:
        module = importlib.import_module(f"{package}.action")
    except ModuleNotFoundError as error:
        if error.name != f"{package}.action":
            raise _broken(package, error) from error
        raise _bad(f"the package {package!r} has no actions.", text) from None
    except Exception as error:  # any error of a broken package
        raise _broken(package, error) from error
    found = getattr(module, name, None)
    if not all(hasattr(found, part) for part in ("Goal", "Result", "Feedback", "Impl")):
        raise _bad(f"the package {package!r} has no action {name!r}.", text)
    return found


def _broken(package: str, error: Exception) -> Problem:
    return Problem(
        Exit.NO_ROS,
        f"the package {package!r} is here, but cannot be imported"
        f" ({type(error).__name__}: {error}). Source the setup file of the workspace that it was"
        " built in, for this Python.",
    )


def _bad(problem: str, text: str) -> click.BadParameter:
    known = installed()
    near = similar_names(text, known, alike=0.7)  # all names have "/action/" in common
    if near:
        hint = f"Did you mean {' or '.join(near)}?"
    elif known:
        hint = f"Installed are: {', '.join(known[:8])}{' and more' if len(known) > 8 else ''}."
    else:
        hint = "No action types at all are installed: source the setup file of your workspace."
    return click.BadParameter(f"{problem} {hint}", param_hint="TYPE")

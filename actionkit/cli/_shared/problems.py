"""Errors that are shown as one line, each with its exit code."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

import click

from actionkit._model.missing import cannot_import
from actionkit.cli._shared import early
from actionkit.cli._shared.exits import Exit
from actionkit.cli._shared.similar_hint import hint_at_similar
from actionkit.cli._shared.stdout import keep_clean
from actionkit.cli._shared.wording import in_options

if TYPE_CHECKING:
    from actionkit._ros.others_goals.survey import Survey


class Problem(click.ClickException):
    """An error that is shown as a line `Error: ...`."""

    def __init__(self, code: Exit, message: str) -> None:
        super().__init__(message)
        self.code = code


def import_ros(*modules: str) -> None:
    """Import rclpy, and other packages of ROS that a command needs.

    Raises:
        Problem: One cannot be imported; the text says what to do.
    """
    for module in ("rclpy", *modules):
        try:
            importlib.import_module(module)
        except Exception as error:  # also errors of a broken middleware
            text = cannot_import(module.partition(".")[0], error)
            raise Problem(Exit.NO_ROS, f"{text}. `actionkit doctor` tells more.") from error
    early.check()


def open_survey() -> Survey:
    """Join the ROS graph.

    Raises:
        Problem: rclpy is not installed, or fails.
    """
    keep_clean()
    import_ros()
    from actionkit._ros.others_goals.survey import Survey

    try:
        return Survey()
    except Exception as error:
        raise Problem(
            Exit.FAILED,
            f"the ROS graph cannot be joined ({type(error).__name__}: {error})."
            " `actionkit doctor` tells more.",
        ) from error


def full_name(survey: Survey, name: str) -> str:
    """Return the full name of an action that this survey is to find.

    From now on, the survey tells the user of a similar name.

    Raises:
        click.BadParameter: It is not a valid name.
    """
    try:
        full = survey.resolve(name)
    except ValueError as error:
        raise click.BadParameter(in_options(str(error)), param_hint="NAME") from error
    hint_at_similar(survey, full)
    return full

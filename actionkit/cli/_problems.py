"""Errors that are shown in one line, each with its exit code."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from actionkit.cli._exits import Exit
from actionkit.cli._stdout import keep_clean

if TYPE_CHECKING:
    from actionkit._ros.tools.survey import Survey


class Problem(click.ClickException):
    """An error that is shown as a line `Error: ...`."""

    def __init__(self, code: Exit, message: str) -> None:
        super().__init__(message)
        self.code = code


def no_ros(error: BaseException) -> Problem:
    """Return the problem that rclpy, or what it needs, cannot be imported."""
    return Problem(
        Exit.NO_ROS,
        f"rclpy cannot be used here ({type(error).__name__}: {error}). On a machine with a ROS"
        " installation source its setup file, such as /opt/ros/jazzy/setup.bash; elsewhere: pip"
        " install 'actionkit[ros]'. `actionkit doctor` tells more.",
    )


def open_survey() -> Survey:
    """Join the ROS graph.

    Raises:
        Problem: rclpy is not there, or refuses.
    """
    keep_clean()
    try:
        from actionkit._ros.tools.survey import Survey
    except Exception as error:  # also what a broken middleware raises
        raise no_ros(error) from error
    try:
        return Survey()
    except Exception as error:
        raise Problem(
            Exit.FAILED,
            f"the ROS graph cannot be joined ({type(error).__name__}: {error})."
            " `actionkit doctor` tells more.",
        ) from error


def full_name(survey: Survey, name: str) -> str:
    """Return the full name of an action.

    Raises:
        click.BadParameter: It is no valid name.
    """
    try:
        return survey.resolve(name)
    except ValueError as error:
        raise click.BadParameter(str(error), param_hint="NAME") from error

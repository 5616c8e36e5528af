"""`actionkit attach`: follow a goal that another program has sent."""

from __future__ import annotations

from typing import Any

import click

from actionkit.cli._shared.exits import Exit
from actionkit.cli._shared.options import HELP, SECONDS, debug_option, json_option, name_argument
from actionkit.cli._shared.problems import Problem, import_ros, open_survey
from actionkit.cli._shared.stdout import keep_clean

_EPILOG = """\b
Examples:
  actionkit watch /fibonacci
  actionkit attach /fibonacci 0f1e2d3c-4b5a-6978-8796-a5b4c3d2e1f0
  actionkit attach /fibonacci 0f1e2d3c-4b5a-6978-8796-a5b4c3d2e1f0 --cancel-on-interrupt --json

Ctrl-C lets the goal run, and the exit code is 130; a second one within two seconds cancels it. The
other exit codes are those of `actionkit call`; 24 means that no server knows the id."""


@click.command("attach", context_settings=HELP, epilog=_EPILOG)
@name_argument
@click.argument("goal_id", metavar="ID")
@click.option(
    "--cancel-on-interrupt", is_flag=True, help="Cancel the goal at the first Ctrl-C, as `call`."
)
@click.option(
    "--timeout",
    type=SECONDS,
    help="How long to follow it. Then the goal goes on. [default: no limit]",
)
@click.option(
    "--server-timeout",
    type=SECONDS,
    default=5.0,
    show_default=True,
    help="Until a server is seen.",
)
@json_option("Write one JSON object on each line.")
@debug_option
def command(
    name: str,
    goal_id: str,
    cancel_on_interrupt: bool,
    timeout: float | None,
    server_timeout: float,
    as_json: bool,
) -> int:
    """Follow a goal of the action NAME that another program has sent, to its result.

    ID is the id of the goal, as `actionkit watch`, errors and logs have it. The action's package
    must be installed here.
    """
    from actionkit._model.goal_ids import goal_id_of

    try:
        followed = goal_id_of(goal_id)
    except ValueError as error:
        raise click.BadParameter(str(error), param_hint="ID") from error
    keep_clean()
    import_ros()
    from actionkit.cli.call import _arguments

    with open_survey() as survey:
        type_name = _arguments.served_type(survey, name, server_timeout, "--server-timeout")
        action = _arguments.action_class(type_name)

        from actionkit import Client, Timeouts

        try:
            client: Any = Client(action, name, timeouts=Timeouts(server=server_timeout))
        except ImportError as error:
            raise Problem(Exit.NO_ROS, str(error)) from error

    from actionkit._internal_api import mute
    from actionkit.cli.call._calling import Calling
    from actionkit.cli.call._reports import JsonReport, Report, TextReport

    mute()  # the report already says what happened to the goal
    report: Report = (
        JsonReport(None, client.action_name, type_name) if as_json else TextReport(None)
    )
    calling = Calling(client, report, echo=True, progress=None, detaches=not cancel_on_interrupt)
    return calling.run(
        lambda on_feedback: client.attach(followed, on_feedback=on_feedback, timeout=timeout)
    )

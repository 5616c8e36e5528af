"""`actionkit show`: show a goal to fill in."""

from __future__ import annotations

import click

from actionkit._model.action_type import type_name_of
from actionkit.cli._shared.exits import Exit
from actionkit.cli._shared.options import HELP, complete_types, debug_option
from actionkit.cli._shared.problems import import_ros
from actionkit.cli._shared.say import say

_EPILOG = """\b
Examples:
  actionkit show test_msgs/action/Fibonacci
  actionkit show test_msgs/action/Fibonacci > goal.yaml
  actionkit call /fibonacci test_msgs/action/Fibonacci --stdin < goal.yaml"""


@click.command("show", context_settings=HELP, epilog=_EPILOG)
@click.argument("type_name", metavar="TYPE", shell_complete=complete_types)
@debug_option
def command(type_name: str) -> int:
    """Show a goal of the action type TYPE to fill in.

    It is YAML as `actionkit call` takes it: each field with its default, its type with bounds, and
    the comments of the .action and .msg files, where they are installed. The fields of the result
    and of the feedback follow as comments.
    """
    import_ros()
    from actionkit.cli.call._arguments import action_class
    from actionkit.cli.call._goal_template import template

    action = action_class(type_name)
    say(template(action, type_name_of(action)))
    return Exit.OK

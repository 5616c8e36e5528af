"""The group `actionkit` and its commands, each in a module of its own."""

from __future__ import annotations

import importlib
from collections.abc import Sequence

import click

from actionkit.cli._exits import Exit

_COMMANDS = {
    "demo": "actionkit.cli.demo",
    "timeline": "actionkit.cli.timeline",
}
"""Name of the command -> module that has it as `command`; imported only where it is needed."""


class _Group(click.Group):
    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the names of all commands."""
        return list(_COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Return the command of that name, or `None`."""
        if cmd_name not in _COMMANDS:
            return None
        command: click.Command = importlib.import_module(_COMMANDS[cmd_name]).command
        return command


@click.group(cls=_Group, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(None, "--version", package_name="actionkit", prog_name="actionkit")
def app() -> None:
    """ActionKit: call ROS 2 actions, with deadlines and real cancellation."""


def run(arguments: Sequence[str] | None) -> int:
    """Run a command.

    Args:
        arguments: The words after `actionkit`; `None` takes them from `sys.argv`.

    Returns:
        The exit code, one of `Exit`.

    Raises:
        KeyboardInterrupt: Ctrl-C.
    """
    try:
        code = app.main(arguments, prog_name="actionkit", standalone_mode=False)
    except click.Abort:  # what click makes of a Ctrl-C
        raise KeyboardInterrupt from None
    except click.ClickException as error:
        error.show()
        return Exit.USAGE if isinstance(error, click.UsageError) else Exit.FAILED
    return Exit(code or Exit.OK)

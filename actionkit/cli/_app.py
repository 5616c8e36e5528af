"""The group `actionkit` and its commands, each in a module of its own."""

from __future__ import annotations

import contextlib
import importlib
import io
import logging
import traceback
from collections.abc import Iterator, Sequence
from typing import Any

import click

from actionkit.cli._exits import Exit
from actionkit.cli._options import HELP, debug_option, debugging
from actionkit.cli._problems import Problem
from actionkit.cli._say import say

_COMMANDS = {
    "call": "actionkit.cli.call",
    "show": "actionkit.cli.show",
    "list": "actionkit.cli.list_actions",
    "info": "actionkit.cli.info",
    "watch": "actionkit.cli.watch",
    "cancel": "actionkit.cli.cancel",
    "serve": "actionkit.cli.serve",
    "doctor": "actionkit.cli.doctor",
    "timeline": "actionkit.cli.timeline",
    "mcp": "actionkit.cli.mcp",
    "demo": "actionkit.cli.demo",
}
"""Name of the command -> module that has it as `command`; imported only where it is needed."""
_OTHER_NAMES = {"send_goal": "call"}
"""Names that `ros2 action` has for them."""


class _OutputClosedError(Exception):
    """Nobody reads the output. Not an OSError: click would end the process without our code."""


@contextlib.contextmanager
def _noticing_closed_output() -> Iterator[None]:
    try:
        yield
    except BrokenPipeError:
        raise _OutputClosedError from None


class _Group(click.Group):
    def make_context(self, *args: Any, **kwargs: Any) -> click.Context:
        # This reads the arguments, and writes the help where it is asked for.
        with _noticing_closed_output():
            return super().make_context(*args, **kwargs)

    def invoke(self, ctx: click.Context) -> Any:
        with _noticing_closed_output():
            return super().invoke(ctx)

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        name = _OTHER_NAMES.get(args[0], args[0])
        if name not in _COMMANDS and not name.startswith("-"):
            from actionkit._model.similar_names import similar_names

            near = similar_names(name, [*_COMMANDS, *_OTHER_NAMES])
            hint = (
                f"Did you mean {' or '.join(map(repr, near))}?"
                if near
                else f"There are: {', '.join(_COMMANDS)}."
            )
            ctx.fail(f"No such command {args[0]!r}. {hint}")
        return super().resolve_command(ctx, [name, *args[1:]])

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(_COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in _COMMANDS:
            return None
        command: click.Command = importlib.import_module(_COMMANDS[cmd_name]).command
        return command


@click.group(
    cls=_Group,
    context_settings=HELP,
    epilog="""\b
Examples:
  actionkit list -t
  actionkit call /fibonacci test_msgs/action/Fibonacci '{order: 5}' --feedback
  actionkit doctor /fibonacci

`actionkit COMMAND --help` tells more. The exit codes are listed by `actionkit call --help`.""",
)
@click.version_option(None, "--version", package_name="actionkit", prog_name="actionkit")
@debug_option
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
        BrokenPipeError: Nobody reads the output any more.
    """
    try:
        code = app.main(
            arguments,
            prog_name="actionkit",
            standalone_mode=False,
            auto_envvar_prefix="ACTIONKIT",  # ACTIONKIT_CALL_SERVER_TIMEOUT=30, for one
        )
    except click.Abort:  # what click makes of a Ctrl-C
        raise KeyboardInterrupt from None
    except _OutputClosedError:
        raise BrokenPipeError from None
    except click.ClickException as error:
        _trace()
        text = io.StringIO()
        error.show(text)
        say(text.getvalue().rstrip("\n"), err=True)
        if isinstance(error, Problem):
            return error.code
        return Exit.USAGE if isinstance(error, click.UsageError) else Exit.FAILED
    except Exception as error:  # noqa: BLE001  a person reads this, not Python
        _trace()
        say(f"Error: {type(error).__name__}: {error}", err=True)
        if not debugging():
            say("The same command with --debug shows where it comes from.", err=True)
        return Exit.FAILED
    return int(code or Exit.OK)


def _trace() -> None:
    if debugging():
        logging.getLogger("actionkit").debug("the error is:")
        say(traceback.format_exc().rstrip(), err=True)

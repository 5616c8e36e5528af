"""The group `actionkit` and the list of its commands; each command has its own module."""

from __future__ import annotations

import contextlib
import importlib
import io
import logging
import traceback
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import click

from actionkit.cli._shared import early
from actionkit.cli._shared.exits import Exit
from actionkit.cli._shared.options import HELP, debug_option, debugging
from actionkit.cli._shared.problems import Problem
from actionkit.cli._shared.say import say
from actionkit.cli._shared.stdout import open_closed


class _Known(NamedTuple):
    """The entry of a command in the list, which needs no import of the command."""

    module: str
    """A module of this package, with the command as `command`."""
    summary: str
    """The first sentence of its help."""


_COMMANDS = {
    "call": _Known(
        "call.call",
        "Send a goal to the action NAME and wait for its result.",
    ),
    "show": _Known(
        "call.show",
        "Show a goal of the action type TYPE to fill in.",
    ),
    "list": _Known(
        "watch.list_actions",
        "List the actions that have a server or a client.",
    ),
    "info": _Known(
        "watch.info",
        "Show the clients and servers of the action NAME.",
    ),
    "watch": _Known(
        "watch.watch",
        "Show the goals of all actions, or of NAME, as they change, and whether agents are held.",
    ),
    "attach": _Known(
        "call.attach",
        "Follow a goal of the action NAME that another program has sent, to its result.",
    ),
    "cancel": _Known(
        "cancel_and_stop.cancel",
        "Cancel goals of the action NAME, and tell what happened to each.",
    ),
    "stop": _Known(
        "cancel_and_stop.stop",
        "Cancel every goal of every action in sight, and hold agents until --release.",
    ),
    "guard": _Known(
        "guard.guard",
        "Run COMMAND, and cancel the goals that it leaves running, however it ends.",
    ),
    "leftovers": _Known(
        "guard.leftovers",
        "Show the goals of programs that were killed and wrote them down in the file PATH.",
    ),
    "serve": _Known(
        "demo.serve",
        "Run the reference action server SERVER and show what it sees.",
    ),
    "doctor": _Known(
        "doctor.doctor",
        "Find out why a call does not work, and say what to do about it.",
    ),
    "timeline": _Known(
        "timeline",
        "Show the goals in FILE, a log of the observer JsonLines or a recording of `ros2 bag`.",
    ),
    "stubs": _Known(
        "interfaces.stubs",
        "Write what type checkers need to know of the types in PACKAGE.",
    ),
    "interfaces": _Known(
        "interfaces.interfaces",
        "Build message, service and action types of your own, without a ROS installation.",
    ),
    "mcp": _Known(
        "mcp",
        "Serve the tools that the TOML file FILE describes, to a language model's host.",
    ),
    "demo": _Known(
        "demo.demo",
        "Show what ActionKit does, on an action server of its own (10 s).",
    ),
}
"""The commands by name, in the order in which they are listed."""
_OTHER_NAMES = {"send_goal": "call"}
"""Their names in `ros2 action`."""


class _OutputClosedError(Exception):
    """Nobody reads the output. Not an OSError, because then click would set the exit code."""


@contextlib.contextmanager
def _noticing_closed_output() -> Iterator[None]:
    try:
        yield
    except BrokenPipeError:
        raise _OutputClosedError from None


class _Group(click.Group):
    def make_context(self, *args: Any, **kwargs: Any) -> click.Context:
        # This parses the arguments, and may write the help.
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
        if cmd_name != "mcp":  # which tells its host what is closed
            open_closed()
        module = importlib.import_module(f"actionkit.cli.{_COMMANDS[cmd_name].module}")
        command: click.Command = module.command
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        # click would import every command: that takes three times as long as all the rest.
        with formatter.section("Commands"):
            formatter.write_dl([(name, known.summary) for name, known in _COMMANDS.items()])


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
    """Run a command; return its exit code, one of `Exit`. The arguments are those of `main`.

    Raises:
        KeyboardInterrupt: Ctrl-C.
        BrokenPipeError: Nobody reads the output any more.
    """
    try:
        with early.remembered():
            code = app.main(
                arguments,
                prog_name="actionkit",
                standalone_mode=False,
                auto_envvar_prefix="ACTIONKIT",  # such as ACTIONKIT_CALL_SERVER_TIMEOUT=30
            )
    except click.Abort:  # click turns Ctrl-C into this
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

"""`actionkit mcp`: serve a robot's actions as tools by the Model Context Protocol."""

from __future__ import annotations

import importlib
import json
import os
import textwrap
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import click

from actionkit._model.environment.domain import LAST_DOMAIN
from actionkit._ros.workarounds.ros_wheels import find_libraries
from actionkit.cli._shared.exits import Exit
from actionkit.cli._shared.options import HELP, debug_option
from actionkit.cli._shared.problems import Problem, import_ros
from actionkit.cli._shared.say import say
from actionkit.cli.guard._leftovers import open_ledger

if TYPE_CHECKING:
    from actionkit import Ledger
    from actionkit.agents import Toolbox

_EPILOG = """\b
Examples:
  actionkit mcp robot.toml --check
  actionkit mcp robot.toml
  actionkit mcp robot.toml --http 127.0.0.1:8765

A host, the program that the language model runs in, starts the first by itself; in its settings:
\b
  {"mcpServers": {"robot": {"command": "actionkit", "args": ["mcp", "/home/me/robot.toml"]}}}

It ends when the host closes its input, by SIGTERM or by Ctrl-C, within 4 seconds; all goals are
cancelled then. The exit code is 143 or 130 after a signal, else 0, or 23 where a goal may still be
running. If it is killed, another process cancels its goals."""

_FOR_PROGRAMS = (
    "Serving MCP on standard input and output, which is for programs: a host starts this command by"
    " itself. `actionkit mcp --help` tells how. Ctrl-C ends it."
)


@click.command("mcp", context_settings=HELP, epilog=_EPILOG)
@click.argument("file", metavar="FILE", type=click.Path(exists=True, dir_okay=False))
@click.option(
    "--http",
    "where",
    metavar="HOST:PORT",
    help="Serve over HTTP instead, at http://HOST:PORT/mcp. Other machines need the token in the"
    " environment variable ACTIONKIT_MCP_TOKEN.",
)
@click.option(
    "--allow-host",
    "names",
    metavar="NAME",
    multiple=True,
    help="Another name under which clients may reach it over HTTP; repeatable.",
)
@click.option(
    "--domain-id",
    type=click.IntRange(0, LAST_DOMAIN),
    help="The ROS domain; else the one in FILE, else the environment's.",
)
@click.option(
    "--check",
    is_flag=True,
    help="Print the tools as a model will see them, and what is not limited. Serve nothing.",
)
@debug_option
def command(
    file: str, where: str | None, names: tuple[str, ...], domain_id: int | None, check: bool
) -> None:
    """Serve the tools that the TOML file FILE describes, to a language model's host."""
    find_libraries()
    if check:
        _print_tools(file)
        return
    # Before importing anything that may write to standard output, which is for the protocol.
    from actionkit.agents._mcp.stdio import Stdio

    if where is not None:
        _serve_http(file, where, names, domain_id)
    if names:
        raise click.UsageError("--allow-host is for --http")
    if os.isatty(0):
        say(_FOR_PROGRAMS, err=True)
    try:
        stdio = Stdio()
    except OSError as error:
        raise Problem(
            Exit.FAILED, f"standard input or output is closed ({error}); a host has to open them"
        ) from error
    toolbox, ledger = _toolbox(file, domain_id)
    from actionkit.agents._mcp.process import serve_stdio

    serve_stdio(toolbox, stdio, _version(), ledger)


def _serve_http(file: str, where: str, names: tuple[str, ...], domain_id: int | None) -> None:
    from actionkit.agents._mcp.address import address, listen
    from actionkit.cli._shared.stdout import keep_clean

    keep_clean()
    try:
        checked = address(where, names, os.environ)
    except ValueError as error:
        raise click.BadParameter(str(error), param_hint="--http") from error
    toolbox, ledger = _toolbox(file, domain_id)
    from actionkit.agents._mcp.http import PATH
    from actionkit.agents._mcp.process import serve_http

    try:
        listening = listen(checked)
    except OSError as error:
        raise Problem(Exit.FAILED, f"cannot serve at {where} ({error.strerror})") from error
    host = f"[{checked.host}]" if ":" in checked.host else checked.host
    say(f"Serving MCP at http://{host}:{listening.getsockname()[1]}{PATH}")
    serve_http(toolbox, checked, listening, _version(), ledger)


def _toolbox(file: str, domain_id: int | None) -> tuple[Toolbox, Ledger]:
    """Read the file; return the toolbox, and the ledger for its goals.

    Raises:
        Problem: A library is missing, the file is wrong, or the ledger cannot be used.
    """
    _import_libraries()
    import_ros()
    from actionkit.agents import Toolbox

    with _problems_of(file):
        toolbox = Toolbox.from_file(file, domain_id=domain_id)
    try:
        _ = toolbox.domain_id
    except ValueError as error:  # of the environment
        raise Problem(Exit.USAGE, str(error)) from error
    ledger = open_ledger(None)
    os.environ["ACTIONKIT_LEDGER"] = str(ledger.path)  # all clients of the toolbox have it
    return toolbox, ledger


def _import_libraries() -> None:
    try:
        for module in ("mcp.server", "uvicorn", "PIL"):
            importlib.import_module(module)
    except ImportError as error:
        raise Problem(
            Exit.FAILED,
            f"{error.name or error} is not installed: pip install 'mcp>=2.2,<3' pillow",
        ) from error


def _print_tools(file: str) -> None:
    _import_libraries()
    from actionkit.agents._configuration.config import read_file
    from actionkit.agents._tools import make_tools

    with _problems_of(file):
        config = read_file(file)
    models = {name: action.fields for name, action in config.tools.items()}
    for tool in make_tools(config):
        say(f"{tool.name}: {tool.description}")
        if (model := models.get(tool.name)) is not None:
            say(f"  Numbers without limits: {', '.join(model.unlimited) or 'none'}")
            say(f"  Not exposed: {', '.join(model.hidden) or 'nothing'}")
        say(textwrap.indent(json.dumps(tool.input_schema, indent=2, ensure_ascii=False), "  "))
        say()


@contextmanager
def _problems_of(file: str) -> Iterator[None]:
    """Tell people what is wrong with the file.

    Raises:
        Problem: Something is.
    """
    from actionkit.agents import ConfigError

    try:
        yield
    except ConfigError as error:
        raise Problem(Exit.USAGE, f"the configuration is wrong:\n{error}") from error
    except OSError as error:
        raise Problem(Exit.USAGE, f"cannot read {file} ({error.strerror})") from error


def _version() -> str:
    from importlib.metadata import version

    return version("actionkit")

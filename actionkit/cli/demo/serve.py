"""`actionkit serve`: run a reference server, for trying things out."""

from __future__ import annotations

from typing import NoReturn

import click

from actionkit.cli._shared.options import HELP, complete_servers, complete_types, debug_option
from actionkit.cli._shared.problems import import_ros

_EPILOG = """\b
Examples:
  actionkit serve --list
  actionkit serve fibonacci --option period=0.2
  actionkit serve flaky --action /dock --option fails=2
  actionkit serve silent --action /pick --type my_robot/action/Pick

It runs until Ctrl-C, which is its normal end: the exit code is 0."""


@click.command("serve", context_settings=HELP, epilog=_EPILOG)
@click.argument("server", metavar="SERVER", required=False, shell_complete=complete_servers)
@click.option("--action", default="fibonacci", show_default=True, help="The action's name.")
@click.option(
    "--type",
    "type_name",
    metavar="TYPE",
    shell_complete=complete_types,
    help="The action's type, for servers that serve any.  [default: the server's own]",
)
@click.option(
    "--option", "options", metavar="KEY=VALUE", multiple=True, help="Of the server; repeatable."
)
@click.option("--list", "list_them", is_flag=True, help="List the servers and leave.")
@debug_option
def command(
    server: str | None,
    action: str,
    type_name: str | None,
    options: tuple[str, ...],
    list_them: bool,
) -> None:
    """Run the reference action server SERVER and show what it sees."""
    from actionkit.servers._serving.child import main

    if list_them:
        main(["--list"])
    if server is None:
        raise click.UsageError("Missing argument 'SERVER'; --list shows them.")
    import_ros("rclpy" if type_name else "test_msgs.action")
    words = [word for option in options for word in ("--option", option)]
    words += ["--type", type_name] if type_name else []
    main([server, "--action", action, "--human", *words], refuse=_refuse)


def _refuse(problem: str) -> NoReturn:
    raise click.UsageError(problem)

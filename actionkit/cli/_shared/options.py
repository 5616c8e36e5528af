"""Options that several commands share, and the completion of their arguments."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any, TypeVar

import click
from click.shell_completion import CompletionItem

from actionkit._model.printable import printable
from actionkit._model.settings import MOST, MOST_TEXT

HELP = {"help_option_names": ["-h", "--help"], "max_content_width": 92}
_F = TypeVar("_F", bound=Callable[..., Any])
_debug: list[bool] = []


def debugging() -> bool:
    """Return whether `--debug` was given."""
    return bool(_debug)


class _Printable(logging.Formatter):
    """Makes the log harmless to a terminal, because it has names and texts of servers in it."""

    def format(self, record: logging.LogRecord) -> str:
        return printable(super().format(record))


def _begin_debugging(ctx: click.Context, param: click.Parameter, value: bool) -> None:
    if value and not ctx.resilient_parsing and not _debug:
        _debug.append(True)
        handler = logging.StreamHandler()
        handler.setFormatter(
            _Printable("%(relativeCreated)8d ms %(name)s %(levelname)s: %(message)s")
        )
        logging.basicConfig(handlers=[handler])
        logging.getLogger("actionkit").setLevel(logging.DEBUG)


def debug_option(command: _F) -> _F:
    return click.option(
        "--debug",
        is_flag=True,
        is_eager=True,
        expose_value=False,
        callback=_begin_debugging,
        help="Show ActionKit's log, and the traceback of an error.",
    )(command)


def json_option(what: str) -> Callable[[_F], _F]:
    """Return a decorator that adds `--json`."""
    return click.option("--json", "as_json", is_flag=True, help=what)


def SECONDS(value: str) -> float:
    """Return a time in seconds, as for `Timeouts`. Help texts show the name of this function."""
    try:
        seconds = float(value)
    except ValueError:
        raise click.BadParameter(f"{value!r} is not a number of seconds") from None
    if not 0 <= seconds <= MOST:
        raise click.BadParameter(f"{value!r} must be zero or more seconds, and {MOST_TEXT} or less")
    return seconds


wait_option = click.option(
    "--wait",
    type=SECONDS,
    default=3.0,
    show_default=True,
    help="How long to look at least. Less may miss somebody: a process that is not seen at once"
    " is seen after up to 3 seconds.",
)


def complete_names(
    ctx: click.Context, param: click.Parameter, incomplete: str
) -> list[CompletionItem]:
    """Return the names of the actions in sight; nothing after any error."""
    try:
        from actionkit._ros.others_goals.survey import Survey
        from actionkit.cli._shared.stdout import keep_clean

        keep_clean()
        # As soon as anything is seen, because people do not wait long after the Tab key.
        with Survey() as survey:
            actions = survey.settled(least=0.5, most=3.5).values()
    except Exception:  # noqa: BLE001
        return []
    return [
        CompletionItem(printable(action.name), help=printable(", ".join(action.types)))
        for action in actions
        if action.name.startswith(incomplete) or action.name[1:].startswith(incomplete)
    ]


def complete_types(
    ctx: click.Context, param: click.Parameter, incomplete: str
) -> list[CompletionItem]:
    """Return the installed action types."""
    from actionkit._messages.by_name import installed

    return [CompletionItem(name) for name in installed() if name.startswith(incomplete)]


def complete_servers(
    ctx: click.Context, param: click.Parameter, incomplete: str
) -> list[CompletionItem]:
    """Return the reference servers."""
    from actionkit.servers import names

    found = names().items()
    return [CompletionItem(name, help=text) for name, text in found if name.startswith(incomplete)]


name_argument = click.argument("name", metavar="NAME", shell_complete=complete_names)

"""Writes all lines of the command line."""

from __future__ import annotations

import shutil
import sys
import textwrap

import click

from actionkit._model.printable import printable

_WIDTH = 96
"""Characters of a line at most; wider text is hard to read."""
_COMMAND = ": actionkit "
"""Before a command that people copy, at the end of a line."""
_JOINT = "\0"
"""Stands for a space where no line may end."""


def say(text: str = "", *, err: bool = False, label: str = "") -> None:
    """Write lines, at once; foreign text in them cannot control the terminal.

    `text` may come from somebody else. `label` is put before it, and may have colours. On a
    terminal, what goes to standard error is wrapped: it is for people only.

    Raises:
        BrokenPipeError: Nobody gets the output: its reader has ended, its disk is full, or it is
            closed. The last two are told on standard error.
    """
    if err and sys.stderr and sys.stderr.isatty():
        text = "\n".join(map(wrapped, text.split("\n")))
    try:
        click.echo(label + printable(text), err=err)
    except BrokenPipeError:
        raise
    except OSError as error:
        if not err:
            say(f"Error: standard output cannot be written ({error.strerror}).", err=True)
        raise BrokenPipeError from error


def wrapped(text: str, indent: int = 0, columns: int | None = None) -> str:
    """Return a line as several ones that fit the terminal, or so many columns.

    All but the first begin with `indent` spaces, and the first has room for as many. Words that are
    longer, such as paths, are not split, and neither are commands: people copy these.
    """
    width = min(_WIDTH, columns or shutil.get_terminal_size((_WIDTH, 24)).columns) - indent
    said, mark, command = text.partition(_COMMAND)
    joined = f"{said}{mark[:-1]}{mark and _JOINT}{command.replace(' ', _JOINT)}"
    lines = textwrap.wrap(joined, max(1, width), break_long_words=False, break_on_hyphens=False)
    return ("\n" + " " * indent).join(lines).replace(_JOINT, " ")

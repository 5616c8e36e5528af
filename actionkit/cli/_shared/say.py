"""Writes all lines of the command line."""

from __future__ import annotations

import click

from actionkit._model.printable import printable


def say(text: str = "", *, err: bool = False, label: str = "") -> None:
    """Write lines, at once; foreign text in them cannot control the terminal.

    `text` may come from somebody else. `label` is put before it, and may have colours.

    Raises:
        BrokenPipeError: Nobody gets the output: its reader has ended, its disk is full, or it is
            closed. The last two are told on standard error.
    """
    try:
        click.echo(label + printable(text), err=err)
    except BrokenPipeError:
        raise
    except OSError as error:
        if not err:
            say(f"Error: standard output cannot be written ({error.strerror}).", err=True)
        raise BrokenPipeError from error

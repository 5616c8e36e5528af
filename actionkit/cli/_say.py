"""The one place where the command line's lines go out."""

from __future__ import annotations

import click

from actionkit._model.printable import printable


def say(text: str = "", *, err: bool = False, label: str = "") -> None:
    """Write lines, at once; what others wrote in them cannot control the terminal.

    Args:
        text: What to write. It may come from somebody else.
        err: Whether to write to standard error.
        label: Words of our own to put before it, which may be styled.
    """
    click.echo(label + printable(text), err=err)

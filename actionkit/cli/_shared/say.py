"""Writes all lines of the command line."""

from __future__ import annotations

import click

from actionkit._model.printable import printable


def say(text: str = "", *, err: bool = False, label: str = "") -> None:
    """Write lines, at once; foreign text in them cannot control the terminal.

    `text` may come from somebody else. `label` is put before it, and may have colours.
    """
    click.echo(label + printable(text), err=err)

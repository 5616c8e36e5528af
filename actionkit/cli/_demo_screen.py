"""What `actionkit demo` looks like: on a terminal, and as plain lines in a pipe or a file."""

from __future__ import annotations

import inspect
import textwrap
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.syntax import Syntax
from rich.text import Text

from actionkit._model.printable import printable

_WIDTH = 92
"""Wider text is hard to read."""


class Screen:
    """Prints headings, code, and what came back. ASCII only: it may be any terminal."""

    def __init__(self, console: Console | None = None) -> None:
        self._console = console or Console(highlight=False, markup=False, emoji=False)
        self._width = min(self._console.width, _WIDTH)

    def heading(self, text: str) -> None:
        """Begin a step."""
        self._console.print()
        self._console.print(Text(text, style="bold"))
        self._console.print(Text("-" * len(text), style="dim"))

    def text(self, text: str, style: str = "", indent: str = "") -> None:
        """Say something, wrapped."""
        lines = textwrap.fill(
            printable(text),
            self._width,
            initial_indent=indent,
            subsequent_indent=" " * len(indent),
            break_long_words=False,
            break_on_hyphens=False,
        )
        self._console.print(Text(lines, style=style), soft_wrap=True)

    def code(self, function: Callable[..., object]) -> None:
        """Show the body of a function, without its docstring and its last line, a `return`."""
        highlighter = Syntax("", "python", theme="ansi_dark", background_color="default")
        shown = highlighter.highlight(textwrap.indent(body_of(function), "    "))
        shown.rstrip()
        self._console.print()
        self._console.print(shown, soft_wrap=True)
        self._console.print()

    def said(self, text: str) -> None:
        """Show what the code above printed."""
        self.text(text, style="green", indent="  -> ")

    def note(self, text: str) -> None:
        """Show what the demo has to say about it."""
        self.text(text, style="dim", indent="     ")

    def failure(self, text: str) -> None:
        """Show that something did not come out as it should."""
        self.text(text, style="bold red", indent="  FAILED: ")

    @contextmanager
    def progress(self, total: int) -> Iterator[Callable[[int, str], None]]:
        """Show how far something is.

        Yields:
            A function of the number of steps done and a few words; callable on any thread.
        """
        if not self._console.is_terminal:
            yield lambda done, words: self.text(f"{done:3} of {total}  {words}", indent="     ")
            return
        columns = (
            TextColumn("    "),
            BarColumn(bar_width=30),
            TextColumn("{task.completed} of {task.total}"),
            TimeElapsedColumn(),
            TextColumn("{task.description}", markup=False),
        )
        with Progress(*columns, console=self._console) as bar:
            task = bar.add_task("", total=total)
            yield lambda done, words: bar.update(task, completed=done, description=words)


class Said:
    """Stands for `print` in the code shown, and keeps what was printed."""

    def __init__(self, screen: Screen, hold: bool = False) -> None:
        """Make one.

        Args:
            screen: Where it is shown.
            hold: Whether to show nothing until `release`, because a progress bar is there.
        """
        self.values: list[Any] = []
        self._screen = screen
        self._held: list[str] | None = [] if hold else None

    def __call__(self, *values: Any) -> None:
        """Show and keep the values."""
        self.values.extend(values)
        line = " ".join(str(value) for value in values)
        if self._held is None:
            self._screen.said(line)
        else:
            self._held.append(line)

    def release(self) -> None:
        """Show what was held back."""
        held, self._held = self._held or [], None
        for line in held:
            self._screen.said(line)


def body_of(function: Callable[..., object]) -> str:
    """Return the source of a function's body, without its docstring and a `return` at its end."""
    lines, _ = inspect.getsourcelines(function)
    # The signature may take several lines; the docstring takes one, and follows it.
    start = next(i for i, line in enumerate(lines) if line.strip().startswith('"""')) + 1
    body = lines[start:]
    if body[-1].strip().startswith("return"):
        body.pop()
    return textwrap.dedent("".join(body)).strip("\n")

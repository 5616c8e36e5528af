"""Prints `actionkit demo` on a terminal, or as plain lines into a pipe or a file."""

from __future__ import annotations

import inspect
import textwrap
from collections.abc import Callable

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.syntax import Syntax
from rich.text import Text

from actionkit._model.printable import printable

_WIDTH = 92
"""Characters; wider text is hard to read."""


class DemoScreen:
    """Prints headings, code and results. ASCII only, so that it works on any terminal."""

    def __init__(self, console: Console | None = None) -> None:
        self._console = console or Console(highlight=False, markup=False, emoji=False)
        self._width = min(self._console.width, _WIDTH)
        self._bar: Progress | None = None

    def heading(self, text: str) -> None:
        self._console.print()
        self._console.print(Text(text, style="bold"))
        self._console.print(Text("-" * len(text), style="dim"))

    def text(self, text: str, style: str = "", indent: str = "") -> None:
        """Print a wrapped text; its first line begins with `indent`, the others align with it."""
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
        """Show the body of a function without its final `return`."""
        _, _, body = inspect.getsource(function).split('"""', 2)  # the docstring is in the middle
        lines = body.strip("\n").splitlines()
        if lines[-1].strip().startswith("return"):
            lines.pop()
        dedented = textwrap.dedent("\n".join(lines)).splitlines()
        code = "\n".join(self._folded(f"    {line}".rstrip()) for line in dedented)
        shown = Syntax("", "python", theme="ansi_dark", background_color="default").highlight(code)
        shown.rstrip()
        self._console.print()
        self._console.print(shown, soft_wrap=True)
        self._console.print()

    def _folded(self, line: str) -> str:
        """Return a line of code, split if it is wider than the screen."""
        indent = " " * (len(line) - len(line.lstrip()) + 8)
        return textwrap.fill(
            line,
            self._width,
            subsequent_indent=indent,
            break_long_words=False,
            break_on_hyphens=False,
        )

    def said(self, text: str) -> None:
        """Show what the code above printed."""
        self.end_progress()
        self.text(text, style="green", indent="  -> ")

    def note(self, text: str) -> None:
        """Show what the demo itself says about a step."""
        self.text(text, style="dim", indent="     ")

    def failure(self, text: str) -> None:
        """Show that a result was not as expected."""
        self.end_progress()
        self.text(text, style="bold red", indent="  FAILED: ")

    def progress(self, done: int, total: int, words: str) -> None:
        """Show progress: a bar on a terminal, else a line. From one thread only."""
        if not self._console.is_terminal:
            self.text(f"{done:3} of {total}  {words}", indent="     ")
            return
        if self._bar is None:
            self._bar = Progress(
                TextColumn("    "),
                BarColumn(bar_width=30),
                TextColumn("{task.completed} of {task.total}"),
                TimeElapsedColumn(),
                TextColumn("{task.description}", markup=False),
                console=self._console,
            )
            self._bar.add_task("", total=total)
            self._bar.start()
        self._bar.update(self._bar.task_ids[0], completed=done, description=words)

    def end_progress(self) -> None:
        """Stop changing the bar, and print below it from now on."""
        if self._bar is not None:
            self._bar.stop()

"""The report of a call on a terminal, with a last line for the goal's progress."""

from __future__ import annotations

from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn
from rich.text import Text

from actionkit._model.printable import printable
from actionkit._model.values import Outcome
from actionkit.cli._shared.exits import Exit
from actionkit.cli.call._reports import Now, TextReport, described, not_shown


class LiveReport(TextReport):
    """Draws a bar if it is known how much is done, else a spinner."""

    def __init__(self, goal: Any, *, bar: bool) -> None:
        """Take the goal message, and whether feedback has the progress."""
        super().__init__(goal)
        self._console = Console(highlight=False, markup=False, emoji=False, soft_wrap=True)
        shown = BarColumn(bar_width=30) if bar else SpinnerColumn("line")
        self._progress = Progress(
            shown,
            TextColumn("{task.description}", markup=False),
            console=self._console,
            # Only the call's own thread draws it; it disappears at the end.
            auto_refresh=False,
            transient=True,
            redirect_stdout=False,
            redirect_stderr=False,
        )
        self._task = self._progress.add_task("", total=1.0)

    def out(self, text: str) -> None:
        self._console.print(Text(printable(text)), soft_wrap=True)

    def not_shown(self, count: int) -> None:
        self.out(not_shown(count))

    def begin(self) -> None:
        super().begin()
        self._progress.start()

    def now(self, now: Now) -> None:
        words = described(now)
        self._progress.update(self._task, completed=now.share or 0.0, description=words)
        self._progress.refresh()

    def finished(self, outcome: Outcome[Any], code: Exit) -> None:
        self._progress.stop()
        super().finished(outcome, code)

    def close(self) -> None:
        self._progress.stop()

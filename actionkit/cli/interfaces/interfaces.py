"""`actionkit interfaces`: build your own message, service and action types."""

from __future__ import annotations

import os
import shlex
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING

import click
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn
from typing_extensions import Self

from actionkit.cli._shared.exits import Exit
from actionkit.cli._shared.options import HELP, debug_option
from actionkit.cli._shared.problems import Problem
from actionkit.cli._shared.say import say

if TYPE_CHECKING:
    from actionkit._interfaces.build import Built
    from actionkit._interfaces.source_tree import Package

_EPILOG = """\b
Examples:
  actionkit interfaces build pick_interfaces --install
  actionkit interfaces build src -o interfaces; export PYTHONPATH=$PWD/interfaces
  actionkit interfaces build src --wheel wheels
  actionkit interfaces build nav2_msgs --only action/NavigateToPose --install
  actionkit interfaces build --own --install

It needs a C++ compiler and the headers of Python, and says how to get them. The compiler's own
variables count: CC, CXX, CPPFLAGS, CFLAGS, CXXFLAGS, LDFLAGS."""


@click.group(
    "interfaces",
    context_settings=HELP,
    epilog="""\b
Examples:
  actionkit interfaces build pick_interfaces --install
  actionkit interfaces build --help""",
)
def command() -> None:
    """Build message, service and action types of your own, without a ROS installation."""


@command.command("build", context_settings=HELP, epilog=_EPILOG)
@click.argument(
    "folder", metavar="DIR", required=False, type=click.Path(path_type=Path, file_okay=False)
)
@click.option(
    "-o",
    "--output",
    metavar="OUT",
    type=click.Path(path_type=Path, file_okay=False),
    help="Put the packages into this folder; with it on PYTHONPATH, Python finds them.",
)
@click.option(
    "--install", is_flag=True, help="Install them into this Python environment, as pip would."
)
@click.option(
    "--only",
    metavar="KIND/NAME",
    multiple=True,
    help="Only this type, such as action/Pick, with what it needs. May be given several times.",
)
@click.option(
    "--own",
    is_flag=True,
    help="Instead of DIR: actionkit_interfaces, which the servers countdown and navigate speak.",
)
@click.option(
    "--wheel",
    "wheels",
    metavar="FOLDER",
    type=click.Path(path_type=Path, file_okay=False),
    help="Write a wheel for each into this folder, to install where there is no compiler.",
)
@debug_option
def build_command(
    folder: Path | None,
    output: Path | None,
    install: bool,
    wheels: Path | None,
    only: tuple[str, ...],
    own: bool,
) -> int:
    """Build the interface packages in DIR, so that Python can import them.

    DIR is a package, with a package.xml and files in msg/, srv/ and action/, or a folder that has
    such packages below it; those that use each other's types are built in that order. What has not
    changed is not built again, and what is there works until the new package takes its place.
    """
    if (folder is None) != own:
        raise click.UsageError("Name the folder to build, DIR; or --own, without DIR.")
    if [output is not None, install, wheels is not None].count(True) != 1:
        raise click.UsageError(
            "Say where the packages go: --install puts them into this Python environment,"
            " -o OUT into a folder, and --wheel FOLDER writes wheels for another computer."
        )
    if output is not None and os.pathsep in str(output.absolute()):
        raise click.BadParameter(
            f"{output.absolute()} has a {os.pathsep!r} in it, so it cannot be on PYTHONPATH:"
            " choose another folder.",
            param_hint="-o",
        )
    from actionkit._interfaces import wheel
    from actionkit._interfaces.build import build
    from actionkit._interfaces.errors import BadSourceError, InterfacesError, MissingToolError
    from actionkit._interfaces.source_tree import OWN

    kind: wheel.Kind = "folder" if output else "wheels" if wheels else "environment"
    try:
        with wheel.opened(kind, output or wheels) as target, _Progress() as progress:
            built = []
            for one in build(folder or OWN, target, only, progress.now):
                built.append(one)
                progress.tell(one)
    except InterfacesError as error:
        usage, tools = isinstance(error, BadSourceError), isinstance(error, MissingToolError)
        raise Problem(
            Exit.USAGE if usage else Exit.NO_ROS if tools else Exit.FAILED, str(error)
        ) from error
    if output is not None:
        folder_word = shlex.quote(str(target.folder))
        say(f"To import from there: export PYTHONPATH={folder_word}${{PYTHONPATH:+:$PYTHONPATH}}")
    elif wheels is not None:
        # All as files, so that pip asks no index for any of them.
        say(f"To install: pip install {shlex.join(str(one.place) for one in built)}")
    return Exit.OK


class _Progress:
    """Shows a build's progress on standard error: a bar on a terminal, else four lines."""

    def __init__(self) -> None:
        console = Console(stderr=True, highlight=False, markup=False, emoji=False)
        self._quarter = -1
        self._bar: Progress | None = None
        if console.is_terminal:
            columns = (BarColumn(bar_width=30), TextColumn("{task.description}", markup=False))
            # Only this thread draws it; it disappears when the package is built.
            self._bar = Progress(*columns, console=console, auto_refresh=False, transient=True)
            self._task = self._bar.add_task("", total=1.0)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        if self._bar is not None:
            self._bar.stop()

    def now(self, package: Package, part: float) -> None:
        count = len(package.files)
        text = f"{package.name}: building {count} type{'s' if count > 1 else ''}, {part:.0%}"
        if self._bar is not None:
            self._bar.start()
            self._bar.update(self._task, completed=part, description=text)
            self._bar.refresh()
        elif int(4 * part) not in (self._quarter, 4):
            self._quarter = int(4 * part)
            say(text, err=True)

    def tell(self, built: Built) -> None:
        if self._bar is not None:
            self._bar.stop()
        self._quarter = -1
        _tell(built)


def _tell(built: Built) -> None:
    name = built.package.name
    if built.seconds is None:
        say(f"{name}: unchanged, in {built.place}")
    else:
        kinds = Counter(file.kind for file in built.package.files)
        what = ", ".join(f"{count} {kind}" for kind, count in sorted(kinds.items()))
        say(f"{name}: built in {built.seconds:.1f} s ({what}), in {built.place}")
    for note in built.notes:
        say(f"Built here, but not by colcon: {note}", err=True)

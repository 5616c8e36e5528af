"""`actionkit stubs`: write type stubs for interface packages."""

from __future__ import annotations

import importlib
import warnings
from pathlib import Path
from typing import TYPE_CHECKING

import click

from actionkit._messages.comments import comments_of
from actionkit._model.similar_names import similar_names
from actionkit._stubs.folders import ForeignFilesError, remove, replace
from actionkit.cli._shared.exits import Exit
from actionkit.cli._shared.options import HELP, debug_option
from actionkit.cli._shared.problems import Problem
from actionkit.cli._shared.say import say

if TYPE_CHECKING:
    from actionkit._stubs.loading import Loaded, Package

_EPILOG = """\b
Examples:
  actionkit stubs my_interfaces
  actionkit stubs my_interfaces nav_msgs -o stubs
  actionkit stubs my_interfaces --install
  actionkit stubs my_interfaces --uninstall

The exit code is 1 where a part could not be written; all the rest is there."""
_NOUNS = {"msg": "message", "srv": "service", "action": "action"}


@click.command("stubs", context_settings=HELP, epilog=_EPILOG)
@click.argument("packages", metavar="PACKAGE...", nargs=-1, required=True)
@click.option(
    "-o",
    "--output",
    metavar="DIR",
    type=click.Path(path_type=Path, file_okay=False),
    help="Write to this folder; without it to typings, where pyright looks by itself.",
)
@click.option("--install", is_flag=True, help="Write beside the installed packages.")
@click.option("--uninstall", is_flag=True, help="Remove what --install wrote for PACKAGE.")
@debug_option
def command(packages: tuple[str, ...], output: Path | None, install: bool, uninstall: bool) -> int:
    """Write what type checkers need to know of the types in PACKAGE.

    So mypy and pyright know the fields of messages, services and actions. The packages that
    PACKAGE uses get stubs, too.
    """
    if (output is not None) + install + uninstall > 1:
        raise click.UsageError(
            "-o, --install and --uninstall exclude each other: stubs go to a folder of yours"
            " (-o DIR) or beside the installed packages (--install)."
        )
    if uninstall:
        return _uninstall(packages)
    where = None if install else output or Path("typings")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # from rosidl's parser, and from generated code
        problems = _write_all(packages, where)
    for problem in problems:
        say(f"Error: {problem}", err=True)
    if where is not None:
        say(
            f"pyright finds them with stubPath = {str(where)!r}"
            f"{' (which is its default)' if str(where) == 'typings' else ''},"
            f" mypy with mypy_path = {str(where)!r} or MYPYPATH={where}."
        )
    return Exit.FAILED if problems else Exit.OK


def _write_all(packages: tuple[str, ...], where: Path | None) -> list[str]:
    """Write stubs of packages and of those that they use; return what went wrong."""
    loaded = load_with_comments(packages)
    problems = []
    for package in loaded.packages:  # the list grows in the loop
        try:
            told = _write(package, loaded, where)
        except ForeignFilesError as error:
            # If a package is only used, somebody else's stubs for it are good enough.
            if package.name in packages:
                problems.append(f"{error} Remove it, or choose another folder with -o DIR.")
                continue
            told = f"left  {error}"
        except OSError as error:
            folder = where or package.folder.parent
            raise _unwritable(error, folder, where is None) from error
        say(told)
    return loaded.problems + problems


def load_with_comments(packages: tuple[str, ...]) -> Loaded:
    """Return packages with the comments of their files."""
    from actionkit._stubs.loading import Loaded, NoSuchPackageError, installed

    try:
        importlib.import_module("rosidl_parser.definition")
        return Loaded(packages, _comments)
    except NoSuchPackageError as error:
        missing = next((name for name in packages if repr(name) in str(error)), "")
        near = [name for name in similar_names(missing, installed()) if name != missing]
        hint = f" Did you mean {' or '.join(near)}?" if near else ""
        source = " Source the setup file of the workspace that has it, or install it with pip."
        raise Problem(Exit.NO_ROS, f"{error}{hint or source}") from error
    except ImportError as error:
        raise Problem(Exit.NO_ROS, f"rosidl_parser cannot be imported ({error}).") from error


def _comments(ros_type: str) -> tuple[list[str], dict[str, list[str]]]:
    found = comments_of(ros_type)
    return found.head, found.fields


def _write(package: Package, loaded: Loaded, where: Path | None) -> str:
    from actionkit._stubs.modules import files, placeholders

    written = files(package, loaded)
    if where is None:
        folder = package.folder.with_name(f"{package.name}-stubs")
    else:
        folder = where / package.name
        written |= placeholders(package)
    changed = replace(folder, written, partial=where is None)
    counts = ", ".join(
        f"{len(types)} {_NOUNS[kind]}{'s' if len(types) > 1 else ''}"
        for kind, types in package.types.items()
    )
    return f"{'wrote' if changed else 'same '} {folder} ({counts})"


def _uninstall(packages: tuple[str, ...]) -> int:
    from actionkit._stubs.loading import folder_of

    for name in packages:
        if (described := folder_of(name)) is None:
            raise Problem(Exit.NO_ROS, f"There is no package {name!r} here.")
        folder = described.with_name(f"{name}-stubs")
        try:
            there = remove(folder)
        except ForeignFilesError as error:
            raise Problem(Exit.FAILED, str(error)) from error
        except OSError as error:
            raise _unwritable(error, folder, True) from error
        say(f"removed {folder}" if there else f"There is no {folder}.")
    return Exit.OK


def _unwritable(error: OSError, folder: Path, install: bool) -> Problem:
    remedy = (
        "Where you may not write there, write to a folder of your own: -o typings."
        if install
        else "Choose a folder that you may write to: -o DIR."
    )
    reason = error.strerror or str(error)
    return Problem(Exit.FAILED, f"stubs cannot be written to {folder} ({reason}). {remedy}")

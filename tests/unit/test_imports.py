"""A program does not import what it does not use (C7.6).

Modules are counted here and not seconds: those depend on the machine.
"""

from __future__ import annotations

import ast
import importlib
import subprocess
import sys
from pathlib import Path

import click
import pytest

import actionkit
from actionkit.cli._app import _COMMANDS, app

SLOW = {"sqlite3", "asyncio", "ssl", "tenacity", "typing_extensions", "rich", "rclpy"}
"""Each takes some milliseconds at least, and asyncio as many as all entities of a client."""
if sys.version_info >= (3, 11):  # uuid of Python 3.10 needs it
    SLOW |= {"subprocess"}


def imported_by(code: str, *arguments: str) -> set[str]:
    """Return the names of all modules that a fresh Python has after `code`."""
    program = f"import sys\ntry:\n    {code}\nfinally:\n    print(*sys.modules, file=sys.stderr)"
    run = [sys.executable, "-c", program, *arguments]
    done = subprocess.run(run, capture_output=True, text=True, timeout=60, check=True)
    return set(done.stderr.split())


def ours(modules: set[str]) -> set[str]:
    return {name for name in modules if name.split(".")[0] == "actionkit"}


def test_importing_actionkit_imports_nothing_else_of_it():
    modules = imported_by("import actionkit")
    assert ours(modules) == {"actionkit"}
    assert modules & SLOW == set()


def test_the_help_imports_no_command():
    modules = imported_by("from actionkit.cli import main; main(['--help'])")
    assert modules & SLOW == set()
    assert len(ours(modules)) <= 20, ours(modules)
    commands = {f"actionkit.cli.{known.module}" for known in _COMMANDS.values()}
    assert modules & commands == set()


def test_a_client_that_blocks_needs_no_asyncio():
    modules = imported_by("from actionkit import Client; import actionkit._ros.sending.connection")
    assert "rclpy" in modules
    assert modules & (SLOW - {"rclpy", "tenacity", "typing_extensions"} | {"click"}) == set()


@pytest.mark.parametrize("name", _COMMANDS)
def test_the_list_of_commands_says_what_each_says_of_itself(name):
    command = app.get_command(click.Context(app), name)
    assert command is not None
    assert _COMMANDS[name].summary == command.get_short_help_str(limit=100)


def test_type_checkers_see_what_is_there():
    tree = ast.parse(Path(actionkit.__file__).read_text("utf-8"))
    checking = next(node for node in tree.body if isinstance(node, ast.If))
    seen = {
        alias.name: str(node.module)
        for node in checking.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert seen == {name: f"actionkit.{where}" for name, where in actionkit._MODULES.items()}
    assert sorted(seen) == sorted(actionkit.__all__)
    for name, module in seen.items():
        assert getattr(actionkit, name) is getattr(importlib.import_module(module), name)
    assert set(actionkit.__all__) <= set(dir(actionkit))


def test_a_name_that_there_is_not():
    with pytest.raises(AttributeError, match="module 'actionkit' has no attribute 'Klient'"):
        actionkit.Klient  # noqa: B018
    with pytest.raises(ImportError, match="Klient"):
        from actionkit import Klient  # noqa: F401

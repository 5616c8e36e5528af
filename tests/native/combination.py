"""The option `--combination`: which servers, and which middleware, the tests run on.

Either those of what is in `PROMISES`, with servers in C++ and with CycloneDDS; or `tests/field`,
with servers of other projects.
"""

from __future__ import annotations

import os
import sys
from collections import Counter
from collections.abc import Container, Iterator
from pathlib import Path
from typing import Any, cast

import pytest

from actionkit.servers import Server
from tests.field import promises as field
from tests.native import build
from tests.native.promises import (
    COMBINATIONS,
    CPP,
    CYCLONE,
    PAGE,
    PROMISES,
    TABLE,
    files,
    is_named,
    row_of,
)
from tests.tables import Cell, Key

_OPTION = "--combination"
_FIELD = "field"
_FOLDER = Path(field.__file__).parent
_WRITE = "ACTIONKIT_WRITE_WHERE_IT_RUNS"
"""With 1 in this variable, the table is written."""
_PROGRAM = f"""
import sys
sys.path.insert(0, {str(build.TOP)!r})
from tests.native.serve import main
main()
"""


def add_option(parser: pytest.Parser) -> None:
    """Add the option."""
    parser.addoption(
        _OPTION,
        choices=(*COMBINATIONS, _FIELD),
        help="run the tests of docs/where-it-runs.md on these servers and this middleware",
    )


def enter(config: pytest.Config) -> None:
    """Build what the chosen combination needs, and start again on its middleware.

    Raises:
        pytest.UsageError: It cannot be built here.
    """
    chosen = config.getoption(_OPTION)
    everything = config.args == config.getini("testpaths")
    if chosen == _FIELD and everything:
        config.args[:] = [str(_FOLDER)]
        if not (hasattr(config, "workerinput") or _is_partial(config.option)):
            config.pluginmanager.register(_FieldPage(), "combination")
    if chosen in (None, _FIELD) or hasattr(config, "workerinput"):
        return
    try:
        build.build()
    except (RuntimeError, OSError) as error:
        raise pytest.UsageError(str(error)) from error
    changed = build.environment() if chosen.endswith(CYCLONE) else {}
    if any(os.environ.get(name) != value for name, value in changed.items()):
        os.execve(sys.executable, sys.orig_argv, {**os.environ, **changed})
    if everything:
        config.args[:] = files()
        config.pluginmanager.register(_Page(), "combination")


def _is_partial(option: Any) -> bool:
    """Whether the command line leaves tests out."""
    words = (option.keyword, option.markexpr, option.deselect, option.ignore, option.collectonly)
    return any(words) or option.lf


def ignores(config: pytest.Config, path: Path) -> bool:
    """Return whether these tests are not looked at, as they are for a combination alone."""
    return path == _FOLDER and config.getoption(_OPTION) != _FIELD


def select(
    config: pytest.Config, items: list[pytest.Item], further: Container[pytest.Item]
) -> bool:
    """Keep the tests of the promises, if a combination is chosen; return whether one is.

    Of `further` variants, those alone that are named.
    """
    chosen = config.getoption(_OPTION)
    if chosen in (None, _FIELD):
        return chosen is not None

    def is_meant(item: pytest.Item) -> bool:
        return row_of(item.nodeid) is not None and (item not in further or is_named(item.nodeid))

    config.hook.pytest_deselected(items=[item for item in items if not is_meant(item)])
    items[:] = filter(is_meant, items)
    return True


def servers(config: pytest.Config) -> Iterator[None]:
    """Have all reference servers be in C++ meanwhile, if the combination says so."""
    with pytest.MonkeyPatch.context() as patch:
        if (config.getoption(_OPTION) or "").startswith(CPP):
            patch.setattr(Server, "_program", ("-c", _PROGRAM))
        yield


class _Tables:
    """Compares tables with what tests have seen, after a run in which all have passed."""

    def __init__(self) -> None:
        self._problem = ""

    def seen(self) -> dict[str, dict[Key, tuple[Cell, ...]]]:
        """Return the rows of each table."""
        raise NotImplementedError

    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        if session.exitstatus:
            return
        for table, rows in self.seen().items():
            if os.environ.get(_WRITE) == "1":
                PAGE.write(table, rows)
                continue
            try:
                PAGE.record(table, rows)
            except AssertionError as error:
                lines = str(error).splitlines()[:-1]
                self._problem += "\n".join([*lines, f"If this is right, run it with {_WRITE}=1\n"])
                session.exitstatus = pytest.ExitCode.TESTS_FAILED

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        if self._problem:
            terminalreporter.section("docs/where-it-runs.md")
            terminalreporter.write_line(self._problem)


class _Page(_Tables):
    """Counts how many tests of each promise have passed."""

    def __init__(self) -> None:
        super().__init__()
        self._passed: Counter[str] = Counter()
        self._skipped: set[str] = set()

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        row = row_of(report.nodeid)
        if row is not None and report.when == "call" and report.passed:
            self._passed[row] += 1
        if row is not None and report.skipped:
            self._skipped.add(row)

    def seen(self) -> dict[str, dict[Key, tuple[Cell, ...]]]:
        # Fast DDS from PyPI has no security: those tests are skipped.
        return {
            TABLE: {(row,): (self._passed[row],) for row in PROMISES if row not in self._skipped}
        }


class _FieldPage(_Tables):
    """Gathers what each server of the field did."""

    def __init__(self) -> None:
        super().__init__()
        self._cells: dict[Key, str] = {}

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.when == "teardown":
            for name, told in report.user_properties:
                if name == field.CELL:
                    server, column, cell = cast("tuple[str, str, str]", told)
                    self._cells[server, column] = cell

    def seen(self) -> dict[str, dict[Key, tuple[Cell, ...]]]:
        return field.rows(self._cells)

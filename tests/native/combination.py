"""The option `--combination`: holds what is in `PROMISES` on servers in C++, and on CycloneDDS."""

from __future__ import annotations

import os
import sys
from collections import Counter
from collections.abc import Container, Iterator

import pytest

from actionkit.servers import Server
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

_OPTION = "--combination"
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
        choices=COMBINATIONS,
        help="run the tests of docs/where-it-runs.md on these servers and this middleware",
    )


def enter(config: pytest.Config) -> None:
    """Build what the chosen combination needs, and start again on its middleware.

    Raises:
        pytest.UsageError: It cannot be built here.
    """
    chosen = config.getoption(_OPTION)
    if not chosen or hasattr(config, "workerinput"):
        return
    try:
        build.build()
    except (RuntimeError, OSError) as error:
        raise pytest.UsageError(str(error)) from error
    changed = build.environment() if chosen.endswith(CYCLONE) else {}
    if any(os.environ.get(name) != value for name, value in changed.items()):
        os.execve(sys.executable, sys.orig_argv, {**os.environ, **changed})
    if config.args == config.getini("testpaths"):
        config.args[:] = files()
        config.pluginmanager.register(_Page(), "combination")


def select(
    config: pytest.Config, items: list[pytest.Item], further: Container[pytest.Item]
) -> bool:
    """Keep the tests of the promises, if a combination is chosen; return whether one is.

    Of `further` variants, those alone that are named.
    """
    if not config.getoption(_OPTION):
        return False

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


class _Page:
    """Compares how many tests of each promise have passed with the page."""

    def __init__(self) -> None:
        self._passed: Counter[str] = Counter()
        self._skipped: set[str] = set()
        self._problem = ""

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        row = row_of(report.nodeid)
        if row is not None and report.when == "call" and report.passed:
            self._passed[row] += 1
        if row is not None and report.skipped:
            self._skipped.add(row)

    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        if session.exitstatus:
            return
        # Fast DDS from PyPI has no security: those tests are skipped.
        seen = {(row,): (self._passed[row],) for row in PROMISES if row not in self._skipped}
        if os.environ.get(_WRITE) == "1":
            PAGE.write(TABLE, seen)
            return
        try:
            PAGE.record(TABLE, seen)
        except AssertionError as error:
            lines = str(error).splitlines()[:-1]
            self._problem = "\n".join([*lines, f"If this is right, run it with {_WRITE}=1"])
            session.exitstatus = pytest.ExitCode.TESTS_FAILED

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        if self._problem:
            terminalreporter.section("docs/where-it-runs.md")
            terminalreporter.write_line(self._problem)

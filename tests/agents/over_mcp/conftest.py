"""Where the rows of docs/agents-faults.md come together, and are compared with those there.

To write the page anew, run these tests with `ACTIONKIT_WRITE_AGENTS=1` in the environment, in one
process (`-n 0`). Otherwise each row that a test comes to has to be the one that is written.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator

import pytest

from tests.agents.over_mcp import lab, page, table
from tests.agents.over_mcp.table import Case, Row

WRITING = os.environ.get("ACTIONKIT_WRITE_AGENTS") == "1"
_ROWS: pytest.StashKey[list[Row]] = pytest.StashKey()

Record = Callable[..., None]


@pytest.fixture
def record(request: pytest.FixtureRequest) -> Record:
    """Take a row of a test, and compare it with the page."""
    rows = request.config.stash.setdefault(_ROWS, [])
    written = {} if WRITING else table.read(table.PATH.read_text("utf-8"))

    def take(
        group: str, fault: str, over: object, reached: str, told: str, process: str = "serves on"
    ) -> None:
        row = Row(Case(group, fault, str(over)), reached, told, process)
        assert row.case in page.cases(), f"page.FAULTS has no {row.case}"
        rows.append(row)
        if not WRITING:
            assert row.seen == written[row.case], f"not as docs/agents-faults.md says: {row.case}"

    return take


def pytest_terminal_summary(
    terminalreporter: pytest.TerminalReporter, config: pytest.Config
) -> None:
    if WRITING:
        terminalreporter.section("docs/agents-faults.md")
        terminalreporter.write_line(page.write(config.stash.get(_ROWS, [])))


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Iterator[lab.Robot]:
    with lab.robot(tmp_path_factory.mktemp("robot")) as made:
        yield made


@pytest.fixture(scope="module")
def http(robot: lab.Robot) -> Iterator[lab.HttpServing]:
    """What serves over HTTP, to all tests of a module that leave it alive."""
    serving = lab.HttpServing(robot)
    yield serving
    serving.close()

"""Where the rows of docs/faults.md come together, and are compared with those written there.

To write the page anew, run these tests with `ACTIONKIT_WRITE_FAULTS=1` in the environment, in
one process (`-n 0`). Otherwise each row that a test comes to has to be the one that is written.
With `ACTIONKIT_WRITE_ATTACKS=1` docs/attacks.md is written, of which only those rows change
that were tried; with `ACTIONKIT_WRITE_ENDING=1` docs/ending.md.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack
from typing import Any

import pytest

from actionkit import Timeouts, servers
from actionkit.servers import Server
from tests.faults import attacks, ending, network, page, table
from tests.faults.callers import LocalCaller, RemoteCaller
from tests.faults.lab import TIMEOUTS
from tests.faults.network import Network
from tests.faults.table import Row

_ROWS: pytest.StashKey[list[Row]] = pytest.StashKey()
_ATTACKS: pytest.StashKey[list[attacks.Row]] = pytest.StashKey()
_ENDINGS: pytest.StashKey[list[ending.Row]] = pytest.StashKey()
WRITING = os.environ.get("ACTIONKIT_WRITE_FAULTS") == "1"
WRITING_ATTACKS = os.environ.get("ACTIONKIT_WRITE_ATTACKS") == "1"
WRITING_ENDING = os.environ.get("ACTIONKIT_WRITE_ENDING") == "1"


@pytest.fixture
def record(request: pytest.FixtureRequest) -> Callable[[Iterable[Row]], None]:
    """Take the rows of a test, and compare them with the page."""
    rows = request.config.stash.setdefault(_ROWS, [])
    written = {} if WRITING else table.read(table.PATH.read_text())

    def take(seen: Iterable[Row]) -> None:
        problems = []
        for row in seen:
            rows.append(row)
            if WRITING:
                continue
            line = written.get(row.case)
            problem = "it is not there" if line is None else line.differs(row)
            if problem:
                problems.append(f"{row.case}: {problem}")
        assert not problems, "not as docs/faults.md says:\n" + "\n".join(problems)

    return take


@pytest.fixture
def attacked(request: pytest.FixtureRequest) -> Callable[[attacks.Row], None]:
    """Take the row of an attack: nothing may be left or wrong, and no delay longer than written."""
    rows = request.config.stash.setdefault(_ATTACKS, [])

    def take(row: attacks.Row) -> None:
        assert (row.left, row.wrong) == (0, 0), row
        rows.append(row)
        if not WRITING_ATTACKS:
            problem = attacks.differs(row, attacks.read(attacks.PATH.read_text()))
            assert not problem, f"not as docs/attacks.md says: {row}: {problem}"

    return take


@pytest.fixture
def ended(request: pytest.FixtureRequest) -> Callable[[ending.Row], None]:
    """Take the row of a program that was ended: it is the one that is written."""
    rows = request.config.stash.setdefault(_ENDINGS, [])

    def take(row: ending.Row) -> None:
        rows.append(row)
        if not WRITING_ENDING:
            assert ending.is_written(row, ending.PATH.read_text()), f"docs/ending.md: {row.line}"

    return take


def pytest_terminal_summary(
    terminalreporter: pytest.TerminalReporter, config: pytest.Config
) -> None:
    if WRITING:
        terminalreporter.section("docs/faults.md")
        terminalreporter.write_line(page.write(config.stash.get(_ROWS, [])))
    if WRITING_ATTACKS:
        rows = config.stash.get(_ATTACKS, [])
        known = attacks.PATH.read_text() if attacks.PATH.exists() else ""
        attacks.PATH.write_text(attacks.merge(rows, known))
        terminalreporter.section("docs/attacks.md")
        terminalreporter.write_line(f"written, {len(rows)} rows of them new")
    if WRITING_ENDING:
        known = ending.PATH.read_text() if ending.PATH.exists() else ""
        ending.PATH.write_text(ending.render(config.stash.get(_ENDINGS, []), known))
        terminalreporter.section("docs/ending.md")
        terminalreporter.write_line("written")


@pytest.fixture
def make_caller(ros_domain: int) -> Iterator[Callable[..., LocalCaller]]:
    """Make clients in this process; they are closed at the test's end."""
    with ExitStack() as stack:

        def make(timeouts: Timeouts = TIMEOUTS) -> LocalCaller:
            caller = LocalCaller(timeouts)
            stack.callback(caller.close)
            return caller

        yield make


class Field:
    """The two hosts, with a server on one of them and a client on the other."""

    def __init__(self, cable: Network, domain: int, stack: ExitStack) -> None:
        self.cable = cable
        self._domain = domain
        self._stack = stack

    def at_the_end(self, do: Callable[[], object]) -> None:
        """Have something done at the end of the test."""
        self._stack.callback(do)

    def serve(self, name: str, **options: Any) -> Server:
        with self.cable.second.inside():
            server = servers.start(name, domain_id=self._domain, **options)
        return self._stack.enter_context(server)

    def caller(self, timeouts: Timeouts = TIMEOUTS) -> RemoteCaller:
        with self.cable.first.inside():
            caller = RemoteCaller(timeouts)
        self._stack.callback(caller.kill)
        assert caller.wait_for_server(20)
        return caller


@pytest.fixture(scope="module")
def possible() -> None:
    """Skip where no hosts can be made."""
    reason = network.why_not()
    if reason:
        pytest.skip(reason)


@pytest.fixture
def field(possible: None, ros_domain: int, monkeypatch: pytest.MonkeyPatch) -> Iterator[Field]:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET")
    # The two hosts share this machine's memory, which a cable has no part in.
    monkeypatch.setenv("FASTDDS_BUILTIN_TRANSPORTS", "UDPv4")
    with network.two_hosts() as cable, ExitStack() as stack:
        yield Field(cable, ros_domain, stack)

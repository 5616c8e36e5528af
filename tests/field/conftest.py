"""Runs a test on each server of the field that can do what the test is about."""

from __future__ import annotations

import dataclasses
import os
import re
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from typing import Any

import pytest

from actionkit import Client, GoalFuture, Timeouts
from tests import forked
from tests.conftest import without_noise
from tests.field.kind import PATIENCE, Goal, Kind, Server
from tests.field.kinds import KINDS
from tests.field.promises import CELL, HELD
from tests.field.sources import Missing


@dataclasses.dataclass
class Field:
    """A server of the field, and who calls it."""

    server: Server
    kind: Kind
    stack: ExitStack
    note: Callable[[str, object], None]
    columns: tuple[str, ...] = ()
    _client: Client[Any] | None = dataclasses.field(default=None, repr=False)

    def goal(self, name: str) -> Goal:
        """Return the goal that makes the server do this."""
        return self.kind.goals[name]

    @property
    def client(self) -> Client[Any]:
        """The first client; it sees the server."""
        if self._client is None:
            self._client = self.another_client()
        return self._client

    def another_client(self, **options: Any) -> Client[Any]:
        """Return one more client, which sees the server."""
        options.setdefault("timeouts", Timeouts(server=30.0, cancel=5.0))
        client = self.stack.enter_context(Client(self.kind.type, self.kind.action_name, **options))
        assert client.wait_for_server(30.0), f"no server; its log:\n{self.server.log}"
        return client

    def accepted(self, name: str = "long") -> GoalFuture[Any, Any]:
        """Send a goal, and return its future when it is accepted."""
        future = self.client.call_async(self.goal(name), timeout=60.0)
        future.wait_accepted(PATIENCE)
        return future

    def running(self, name: str = "long", **options: Any) -> GoalFuture[Any, Any]:
        """Send a goal, and return its future when the server's log says that it runs."""
        before = self.server.count("executing")
        future = self.client.call_async(self.goal(name), **{"timeout": 60.0, **options})
        self.server.wait_for("executing", before + 1)
        return future

    def command(self, *words: str) -> Said:
        """Run the command line."""
        # Not by PYTHONPATH, with which no program is forked.
        code = f"import sys; sys.path[:] = {sys.path}; from actionkit.cli import main; main()"
        done = forked.run(
            [sys.executable, "-c", code, *words],
            capture_output=True,
            text=True,
            env=os.environ | {"COLUMNS": "200"},
            timeout=2 * PATIENCE,
        )
        said = Said(done.returncode, without_noise(done.stdout), without_noise(done.stderr))
        assert "Traceback" not in said.err, said.err
        return said

    def saw(self, cell: str) -> None:
        """Write this into the table, instead of "yes"."""
        (column,) = self.columns
        self.note(CELL, (self.kind.name, column, cell))

    def told(self, what: str, call: str) -> None:
        """Write into the table of what can happen on this server alone what the call says then."""
        assert what in self.kind.own
        self.note(CELL, (self.kind.name, what, call))


@dataclasses.dataclass(frozen=True)
class Said:
    """How a command ended."""

    code: int
    out: str
    err: str


def start(kind: Kind) -> Server:
    """Start a server; skip the test, with the reason, if it cannot be built here."""
    try:
        return Server(kind)
    except Missing as missing:
        pytest.skip(str(missing))


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    marker = metafunc.definition.get_closest_marker("field")
    if marker is None:
        return
    can = marker.kwargs.get("can", lambda kind: "long" in kind.goals)
    kinds = [kind for kind in marker.kwargs.get("kinds", KINDS) if can(kind)]
    metafunc.parametrize("kind", kinds, ids=[_id(kind) for kind in kinds])


def _id(kind: Kind) -> str:
    return re.sub(r"[^a-z0-9_]+", "-", kind.name.lower()).strip("-")


@pytest.fixture
def field(
    request: pytest.FixtureRequest,
    kind: Kind,
    ros_domain: int,
    record_property: Callable[[str, object], None],
) -> Iterator[Field]:
    """Start the server; the test's columns are in the table if all tests pass."""
    server = start(kind)
    columns = request.node.get_closest_marker("field").args
    with ExitStack() as stack:
        stack.callback(server.close)
        told: list[tuple[str, object]] = []
        one = Field(server, kind, stack, lambda *what: told.append(what), columns)
        yield one
        for column in columns:
            record_property(CELL, (kind.name, column, HELD))
        for what in told:
            record_property(*what)

"""A robot with tools, and what serves them over HTTP."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.agents.over_mcp import lab


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

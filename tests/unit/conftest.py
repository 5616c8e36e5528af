"""Unit tests use no middleware, so they are fast and run anywhere."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

HERE = Path(__file__).parent


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Have no test here run again when it fails: nothing here depends on a server or on time."""
    for item in items:
        if HERE in item.path.parents:
            item.add_marker(pytest.mark.flaky(reruns=0))


@pytest.fixture(scope="module", autouse=True)
def _no_middleware() -> Iterator[None]:
    """Let no test here start a ROS context, which the client, a server or a node would need."""

    def init(*_: object, **__: object) -> None:
        raise AssertionError("this belongs outside of tests/unit: it uses rclpy's middleware")

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("rclpy.context.Context.init", init)
        yield

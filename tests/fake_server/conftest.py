"""What tests of fake servers share: a plain client of rclpy's, and what a server went through."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from actionkit import (
    RetryPolicy,
)
from actionkit.testing import FakeServer
from tests.rclpy_client import Driver

ACCEPTED = ["received", "accepted", "executing"]
FIELDS = {"sequence": [3, 1]}
NOT_RETRIED = RetryPolicy.none()


@pytest.fixture
def driver(ros_domain: int) -> Iterator[Driver]:
    driver = Driver(ros_domain)
    yield driver
    driver.close()


def names(server: FakeServer[Any, Any, Any], goal_id: object = None) -> list[str]:
    return [e.event for e in server.events if goal_id is None or e.goal_id == str(goal_id)]

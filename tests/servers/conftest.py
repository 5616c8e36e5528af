"""Shared by tests of the reference servers: plain rclpy clients, and servers with checks."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from test_msgs.action import NestedMessage

from tests.rclpy_client import Driver, checked


@pytest.fixture
def driver(ros_domain: int) -> Iterator[Driver]:
    driver = Driver(ros_domain)
    yield driver
    driver.close()


@pytest.fixture
def nested(ros_domain: int) -> Iterator[Driver]:
    """A client of NestedMessage."""
    driver = Driver(ros_domain, NestedMessage)
    yield driver
    driver.close()


@pytest.fixture
def action_server(action_server: Any) -> Iterator[Any]:
    """As the plugin's, and it checks that every server leaves in good order."""
    with checked(action_server) as start:
        yield start

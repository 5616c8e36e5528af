"""The pytest plugin. Loaded by pytest itself wherever ActionKit is installed.

So nothing heavy is imported here: people run pytest for other things, and may have no rclpy.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from typing import TYPE_CHECKING, Protocol

import pytest

if TYPE_CHECKING:
    from actionkit.servers import Server
    from actionkit.servers._behaviour import Option


class ActionServerFactory(Protocol):
    """The type of the `action_server` fixture."""

    def __call__(
        self, name: str, *, action_name: str = "fibonacci", **options: Option
    ) -> Server: ...


@pytest.fixture
def ros_domain(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """Return the id of a ROS domain that this test has for itself, on this machine only.

    It is set in the environment, so everything that the test starts is in it, but no context that
    was initialised before.
    """
    from actionkit.testing._domains import isolated_domain

    with isolated_domain() as domain:
        monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
        monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        # The older variable overrules the range, and peers would be looked for beyond it.
        monkeypatch.delenv("ROS_LOCALHOST_ONLY", raising=False)
        monkeypatch.delenv("ROS_STATIC_PEERS", raising=False)
        yield domain


@pytest.fixture
def action_server(ros_domain: int) -> Iterator[ActionServerFactory]:
    """Return a function that starts reference servers in the test's own ROS domain.

    ::

        def test_it(action_server):
            server = action_server("countdown", action_name="count", period=0.01)

    They are stopped at the end of the test.
    """
    from actionkit import servers

    with ExitStack() as running:

        def start(name: str, *, action_name: str = "fibonacci", **options: Option) -> Server:
            return running.enter_context(
                servers.start(name, action_name=action_name, domain_id=ros_domain, **options)
            )

        yield start

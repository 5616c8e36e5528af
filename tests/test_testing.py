"""The helpers for tests: domains, the pytest plugin, the event log."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from actionkit.testing import EventLog, _domains, isolated_domain


def test_domains_do_not_meet_and_rest() -> None:
    with isolated_domain() as first, isolated_domain() as second:
        assert len({first, second}) == 2
        assert 1 <= first <= 101
    with isolated_domain() as third:
        assert third not in (first, second)


def test_the_domain_is_none_that_is_used(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """On a robot's computer, that of the environment is the robot's, also on this computer."""
    from rclpy.context import Context

    monkeypatch.setattr(_domains, "_directory", lambda: tmp_path)  # so that 1 is the first
    monkeypatch.setenv("ROS_DOMAIN_ID", "1")
    with isolated_domain() as domain:
        assert domain == 2
        left = Context()
        left.init(args=[], initialize_logging=False, domain_id=2)
    with isolated_domain() as domain:
        assert domain == 3, "what an earlier test has left in its domain does no harm"
    for later in (2, 4, 5):  # whether a test had that domain before, will have it, or neither
        used = Context()
        used.init(args=[], initialize_logging=False, domain_id=later)
        with pytest.raises(RuntimeError, match=f"up in domain {later} "), isolated_domain():
            pass
        used.shutdown()
    left.shutdown()


def test_a_closed_client_that_keeps_its_node_for_a_moment_is_in_no_domain(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    from test_msgs.action import Fibonacci

    from actionkit import Client

    domain, lock = _domains._claim(_domains._directory())
    monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    client = Client(Fibonacci, "fibonacci")
    runtime = client._session.connection.runtime
    with pytest.raises(RuntimeError, match=f"up in domain {domain} "), isolated_domain():
        pass
    runtime.run(lambda: runtime.keep_until(time.monotonic() + 60))
    client.close()
    with isolated_domain():
        pass
    runtime.keep_no_longer()
    os.close(lock)


def test_the_domain_is_in_the_environment(ros_domain: int) -> None:
    assert os.environ["ROS_DOMAIN_ID"] == str(ros_domain)
    assert os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "LOCALHOST"


def test_event_log() -> None:
    log: EventLog[int] = EventLog()
    thread = threading.Thread(target=lambda: [log(n) for n in range(5)])
    thread.start()
    assert log.wait_for(lambda n: n == 3) == 3
    assert log.wait_for(5) == [0, 1, 2, 3, 4] == list(log)
    thread.join()
    log.append(7)
    assert len(log) == 6
    wanted: list[int | Callable[[int], bool]] = [7, lambda n: n == 8]
    for one in wanted:
        with pytest.raises(TimeoutError, match="7"):
            log.wait_for(one, timeout=0)


def test_the_test_in_the_tour(action_server: Callable[..., object]) -> None:
    from test_msgs.action import Fibonacci

    from actionkit import Client
    from tests.docs.snippets import blocks
    from tests.docs.test_pages import DOCS

    (code,) = [each.text for each in blocks(DOCS / "client.md") if "def test_" in each.text]
    names: dict[str, Any] = {"Client": Client, "Fibonacci": Fibonacci}
    exec(code, names)
    names["test_an_abort_is_an_error"](action_server)

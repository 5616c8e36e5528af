"""Keeps what tests do in ROS domains of their own, away from real robots.

Tests reserve a domain (`actionkit.testing.isolated_domain`). As long as one is reserved, nothing of
ActionKit enters any other domain in this process.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager

_reserved: Counter[int] = Counter()
"""How many tests have reserved each domain; a test may reserve a second one."""


@contextmanager
def only_in(domain_id: int) -> Iterator[None]:
    """Refuse other domains in this process, except those for which the same was said."""
    _reserved[domain_id] += 1
    try:
        yield
    finally:
        _reserved[domain_id] -= 1


def reserved() -> frozenset[int]:
    """Return the domains that tests of this process have reserved now."""
    return frozenset(domain for domain, tests in list(_reserved.items()) if tests > 0)


def check_domain(domain_id: int) -> None:
    """Check that tests of this process may use a domain.

    Raises:
        RuntimeError: They have reserved others.
    """
    allowed = reserved()
    if allowed and domain_id not in allowed:
        own = " and ".join(map(str, sorted(allowed)))
        raise RuntimeError(
            f"a test of this process has ROS domain {own} for itself (`ros_domain`, `fake_server`,"
            f" `action_server` or `isolated_domain()`), but this would go to domain {domain_id},"
            f" where a real robot may be. {REMEDY}"
        )


REMEDY = (
    "A context keeps the domain in which it was initialised. So call rclpy.init() and make clients"
    " when the test has its domain, and end them with the test: a fixture that does so must ask for"
    " `ros_domain`, as in `def node(ros_domain): rclpy.init()`, and be one of each test, not of a"
    " session, module or class. In unittest, do it in setUp and tearDown, not in setUpClass"
)

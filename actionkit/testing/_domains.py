"""Finds ROS domains that no other test run on this machine uses at the same time."""

from __future__ import annotations

import fcntl
import gc
import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from actionkit._model.environment.domain import environment_domain
from actionkit._model.environment.isolation import REMEDY, only_in, reserved

_FIRST, _LAST = 1, 101
"""Domains above 101 use ports in Linux's ephemeral range, where any program's connection may use
them. 0 is the default for everybody."""
_COUNT = _LAST - _FIRST + 1


@contextmanager
def isolated_domain() -> Iterator[int]:
    """Reserve a ROS domain for tests. No other caller on this machine gets it meanwhile.

        with isolated_domain() as domain:
            rclpy.init(domain_id=domain)

    It does not change the environment, and contexts do not change their domain. So ActionKit
    refuses clients, fake servers and everything else in any other domain meanwhile: a real robot
    may be there. Another computer in the network may use the same domain, unless you set the
    variable `ROS_AUTOMATIC_DISCOVERY_RANGE` to `LOCALHOST` before ROS is initialised. The fixture
    `ros_domain` does that, and also sets the domain in the environment.

    The environment's domain is never chosen: on a robot's computer, it is the robot's domain.

    A lock on a file reserves the domain. The system releases the lock when the process dies. All
    processes take the domains in turn, so a domain that was just released is not used for a while:
    the middleware may still discover its last users.

    Yields:
        The id of the domain, 1 to 101.

    Raises:
        RuntimeError: All domains are taken. Or a context of this process is up in a domain that was
            not reserved: from your node, from an earlier `rclpy.init()`, or from a client.
    """
    others = reserved()
    domain, lock = _claim(_directory())
    try:
        with only_in(domain):  # from here on, no thread makes a client elsewhere
            _refuse_contexts_elsewhere(others)
            try:
                yield domain
            finally:
                _remember_what_is_left(domain)
    finally:
        os.close(lock)


def domain_of_default_context() -> int | None:
    """Return the domain of `rclpy.init()` if it is reserved; `None` if ROS is not initialised.

    Raises:
        RuntimeError: It is in another domain, and was not shut down.
    """
    if "rclpy" not in sys.modules:
        return None
    from actionkit._ros.tools.contexts import default_domain

    domain = default_domain()
    if domain is not None and domain not in reserved():
        raise RuntimeError(_told(domain))
    return domain


def _refuse_contexts_elsewhere(others: frozenset[int]) -> None:
    """Raise if a context is up in another domain than the `others`, which tests have reserved."""
    if "rclpy" not in sys.modules:  # then there is none
        return
    from actionkit._ros.tools.contexts import domains_in_use

    for collected in (False, True):
        found = domains_in_use() - others
        if not found:
            return
        if not collected:
            gc.collect()  # a node that nobody has any more
    raise RuntimeError(_told(min(found)))


def _remember_what_is_left(domain: int) -> None:
    """Let later tests not fail because this one has left a context up, where it does no harm."""
    if "rclpy" in sys.modules:
        from actionkit._ros.tools.contexts import leave_out

        leave_out(domain)


def _told(domain: int) -> str:
    return (
        f"ROS is already up in domain {domain} in this process: by rclpy.init(), or by a node or an"
        " ActionKit client with a context of its own. What a test does there would reach the"
        f" servers of that domain, which may be those of a real robot. {REMEDY}"
    )


def _directory() -> Path:
    directory = Path(tempfile.gettempdir()) / f"actionkit-domains-{os.getuid()}"
    directory.mkdir(mode=0o700, exist_ok=True)
    if directory.stat().st_uid != os.getuid():
        raise RuntimeError(f"{directory} belongs to another user")
    return directory


def _claim(directory: Path) -> tuple[int, int]:
    """Return a domain that is free, and the descriptor of its lock."""
    try:
        users = environment_domain()
    except ValueError:  # it names no domain
        users = 0
    turn = os.open(directory / "turn", os.O_RDWR | os.O_CREAT, 0o600)
    try:
        fcntl.flock(turn, fcntl.LOCK_EX)
        text = os.pread(turn, 16, 0)
        last = int(text) if text.strip().isdigit() else _LAST
        for step in range(_COUNT):
            domain = _FIRST + (last - _FIRST + 1 + step) % _COUNT
            if domain == users:
                continue
            descriptor = os.open(directory / f"{domain}.lock", os.O_RDWR | os.O_CREAT, 0o600)
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                os.close(descriptor)
                continue
            # All of one width, so that a shorter number leaves no digit of the last one.
            os.pwrite(turn, f"{domain:<4}".encode(), 0)
            return domain, descriptor
    finally:
        os.close(turn)
    raise RuntimeError(f"all {_COUNT} ROS domains are in use; their locks are in {directory}")

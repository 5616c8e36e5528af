"""Finds the ROS contexts of this process that are up: for tests, which must not use any of them."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import suppress
from weakref import WeakSet

from rclpy.context import Context
from rclpy.exceptions import InvalidHandle

from actionkit._ros.communication import runtimes
from actionkit._ros.rclpy_private import native

_left_out: WeakSet[Context] = WeakSet()


def domains_in_use() -> set[int]:
    """Return the domains of all contexts that are up: the user's, and those of our clients.

    Without those that were left out, and those of clients that were closed. It takes some 10 ms,
    because rclpy has no list of contexts.
    """
    known = {*runtimes.contexts_ending(), *_left_out}
    return {domain for context, domain in _contexts_up() if context not in known}


def leave_out(domain_id: int) -> None:
    """Leave out the contexts that are up in this domain now."""
    _left_out.update(context for context, domain in _contexts_up() if domain == domain_id)


def _contexts_up() -> Iterator[tuple[Context, int]]:
    found = {one for one in gc.get_referrers(Context) if isinstance(one, Context)}
    default = native.default_context()  # it may be hidden from the search by `gc.freeze`
    for context in found if default is None else found | {default}:
        with suppress(InvalidHandle):  # it was destroyed just now
            if context.handle is not None and native.is_up(context):
                yield context, native.domain_of(context)


def default_domain() -> int | None:
    """Return the domain of the context of `rclpy.init()`; `None` if it is not up."""
    context = native.default_context()
    if context is None:
        return None
    try:
        return native.domain_of(context) if native.is_up(context) else None
    except InvalidHandle:  # it was shut down just now
        return None

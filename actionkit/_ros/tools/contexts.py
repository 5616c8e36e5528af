"""Finds the ROS contexts of this process that are up: for tests, which must not use any of them."""

from __future__ import annotations

import gc
from contextlib import suppress

from rclpy.context import Context
from rclpy.exceptions import InvalidHandle

from actionkit._ros import native, runtimes


def domains_in_use() -> set[int]:
    """Return the domains of all contexts that are up: the user's, and those of our clients.

    It takes some 10 ms, because rclpy has no list of contexts.
    """
    found = {one for one in gc.get_referrers(Context) if isinstance(one, Context)}
    found -= runtimes.contexts_ending()
    domains = set()
    for context in found:
        with suppress(InvalidHandle):  # it was destroyed just now
            if context.handle is not None and native.is_up(context):
                domains.add(native.domain_of(context))
    default = default_domain()  # it may be hidden from the search by `gc.freeze`
    return domains if default is None else domains | {default}


def default_domain() -> int | None:
    """Return the domain of the context of `rclpy.init()`; `None` if it is not up."""
    context = native.default_context()
    if context is None:
        return None
    try:
        return native.domain_of(context) if native.is_up(context) else None
    except InvalidHandle:  # it was shut down just now
        return None

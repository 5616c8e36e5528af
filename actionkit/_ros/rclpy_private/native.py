"""Asks contexts and nodes of rclpy for what it keeps private, and does not take their locks."""

from __future__ import annotations

from collections.abc import Callable
from weakref import WeakMethod

from rclpy import utilities
from rclpy.context import Context
from rclpy.exceptions import InvalidHandle
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node

RCLError = rclpy_implementation.RCLError
GONE = (RCLError, InvalidHandle)
"""The errors of rclpy where the context was shut down, or the node was destroyed."""


def is_up(context: Context) -> bool:
    """Return whether the context is not shut down. Safe in a signal handler.

    `Context.ok()` takes a lock: if a handler interrupts it and calls it, the handler waits for
    ever.
    """
    handle = context.handle
    try:
        with handle:
            return handle.ok()
    except InvalidHandle:
        return False


def shut_down(context: Context) -> None:
    """Shut down a context; rclpy's signal handler may do it at the same moment."""
    try:
        context.try_shutdown()
    except RCLError:  # shut down after the check (R10)
        if is_up(context):
            raise


def domain_of(context: Context) -> int:
    """Return the domain of a context, without the lock of `Context.get_domain_id()`.

    Raises:
        InvalidHandle: The context was destroyed.
        RuntimeError: It was not initialised.
    """
    handle = context.handle
    if handle is None:
        return context.get_domain_id()  # its error says what is wrong
    with handle:
        return handle.get_domain_id()


def default_context() -> Context | None:
    """Return the context of `rclpy.init()`; `None` before that.

    `rclpy.get_default_context()` takes a lock: see `is_up`.
    """
    context: Context | None = utilities.g_default_context
    return None if context is None or context.handle is None else context


def default_context_is_up() -> bool:
    """Return whether there is a context of `rclpy.init()` that is not shut down."""
    context = default_context()
    return context is not None and is_up(context)


def node_is_destroyed(node: Node) -> bool:
    """Return whether `destroy_node()` was called; rclpy has no public way to ask."""
    try:
        with node.handle:
            return False
    except InvalidHandle:
        return True


def on_shutdown(context: Context, method: Callable[[], None]) -> None:
    """Call a bound method when the context is shut down, but not by a signal handler.

    It is called on the thread that shuts down, during the shutdown. The context keeps no reference
    to its object. Check afterwards whether the context was already shut down.

    `Context.on_shutdown()` takes the lock of `Context.ok()`: see `is_up`.
    """
    context._callbacks.append(WeakMethod(method, context._remove_callback))


def outlive_shutdown(node: Node) -> None:
    """Keep our node in a context that is shut down; its owner destroys it.

    From ROS 2 Kilted on, a context that is shut down destroys its nodes first, on the thread that
    shuts down. Our communication thread may wait on their entities at that moment, and cancels
    goals through them after it.
    """
    untrack = getattr(node.context, "untrack_node", None)
    if untrack is not None:
        untrack(node)

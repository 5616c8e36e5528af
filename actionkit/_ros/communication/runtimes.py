"""Keeps the runtimes of this process: one for each context of the user's. Without such a context,
there is one for each ROS domain, in a context of our own.

Each runtime counts its users on its own thread. So no lock is needed between a thread that needs a
runtime and the thread of a runtime that is ending (see `docs/architecture.md`, "Locks").
"""

from __future__ import annotations

import threading
import time
from functools import partial
from typing import TypeAlias
from weakref import WeakSet

from rclpy.context import Context

from actionkit._model.environment.domain import environment_domain
from actionkit._model.environment.isolation import check_domain
from actionkit._ros.communication.runtime import Runtime
from actionkit._ros.rclpy_private.native import domain_of

Place: TypeAlias = "Context | int"
"""A context of the user's, or a ROS domain."""


class _Registry:
    """The runtimes of this process."""

    def __init__(self) -> None:
        self.starting = threading.RLock()
        """Held while a runtime starts, so that two threads do not start two. The communication
        thread never waits for it."""
        self.by_place: dict[Place, Runtime] = {}
        self.ending: WeakSet[Runtime] = WeakSet()
        self.unheard: WeakSet[Context] = WeakSet()
        """Contexts of the user's with participants that some servers do not discover any more."""

    def forget(self, runtime: Runtime) -> None:
        """Remove a runtime that is ending. Called on its thread, while it is usable."""
        for place, known in list(self.by_place.items()):
            if known is runtime:
                del self.by_place[place]
        self.ending.add(runtime)
        if runtime.is_apart:
            self.unheard.add(runtime.context)


_registry = _Registry()
_inherited: list[_Registry] = []
"""The registries of the parent processes, kept for ever: destroying their entities here would break
the parent's."""


def acquire(place: Context | int | None, user: object) -> Runtime:
    """Return the runtime of a place; start one if there is none that is usable.

    `place` is a context of the user's that is up; or a ROS domain, for a context of our own; or
    `None` for the domain that the environment names. `user` is the object for `release`: the
    runtime lives at least until then.

    Raises:
        ValueError: The environment names no domain, or rcl refuses the arguments of the process.
        RuntimeError: The place is in another domain than the test that runs in this process.
    """
    place = environment_domain() if place is None else place
    check_domain(domain_of(place) if isinstance(place, Context) else place)
    while True:
        runtime = _usable_runtime(place)
        try:
            if runtime.run(partial(runtime.add_user, user)):
                return runtime
        except BaseException:  # also after Ctrl-C: nobody would call `release`
            runtime.call_soon(partial(runtime.remove_user, user))
            raise


def _usable_runtime(place: Place) -> Runtime:
    with _registry.starting:
        runtime = _registry.by_place.get(place)
        if runtime is None or not runtime.usable:
            runtime = _registry.by_place[place] = Runtime(
                place, _registry.forget, apart=place in _registry.unheard
            )
        return runtime


def release(runtime: Runtime, user: object) -> None:
    """Release a runtime. It ends when its last user releases it."""
    runtime.run(partial(runtime.remove_user, user))


def contexts_ending() -> set[Context]:
    """Return the contexts of ours that nobody uses any more, and that are still up for a moment."""
    return {own for runtime in _registry.ending if (own := runtime.own_context) is not None}


def join_ending(timeout: float, *, at_once: bool = False) -> None:
    """Wait for the threads that were told to end, including those that still keep their node.

    `at_once` means that they do not keep it any longer, because a human does not want to wait.
    """
    until = time.monotonic() + timeout
    for runtime in list(_registry.ending):
        if at_once:
            runtime.keep_no_longer()
        runtime.join(until - time.monotonic())


def end_all(timeout: float, *, at_once: bool = False) -> None:
    """End all threads at the interpreter's exit, and wait for them as `join_ending` does.

    A thread that is still in use belongs to a client that was interrupted while it was made.
    """
    for runtime in list(_registry.by_place.values()):
        runtime.call_soon(runtime.end)
        _registry.ending.add(runtime)
    join_ending(timeout, at_once=at_once)


def forget_inherited() -> None:
    """Begin without runtimes in a process that was forked: its parent's cannot be used (R20)."""
    global _registry  # noqa: PLW0603  with a new lock: a thread that is not here may hold the old one
    _inherited.append(_registry)
    _registry = _Registry()

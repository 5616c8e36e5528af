"""The runtimes of this process: one for each context of the user's, and of our own where there is
none, one for each ROS domain.

The users of a runtime are counted on its own thread. So no lock is needed between a thread that
needs a runtime and the thread of a runtime that is ending (see `docs/architecture.md`, "Locks").
"""

from __future__ import annotations

import threading
import time
from functools import partial
from typing import TypeAlias
from weakref import WeakSet

from rclpy.context import Context

from actionkit._model.domain import environment_domain
from actionkit._ros.runtime import Runtime

Place: TypeAlias = "Context | int"
"""A context of the user's, or a ROS domain."""


class _Registry:
    """The runtimes of this process."""

    def __init__(self) -> None:
        self.starting = threading.RLock()
        """Held while a runtime is started, so that two threads do not start two. The communication
        thread never waits for it."""
        self.by_place: dict[Place, Runtime] = {}
        self.ending: WeakSet[Runtime] = WeakSet()
        self.unheard: WeakSet[Context] = WeakSet()
        """Contexts of the user's with participants that some servers do not find any more."""

    def forget(self, runtime: Runtime) -> None:
        """Remove a runtime that is ending. Called on its thread, while it is still usable."""
        for place, known in list(self.by_place.items()):
            if known is runtime:
                del self.by_place[place]
        self.ending.add(runtime)
        if runtime.is_apart:
            self.unheard.add(runtime.context)


_registry = _Registry()
_inherited: list[_Registry] = []
"""Those of the process that this one was forked from. They are kept for ever, because destroying
their entities here would break the parent's."""


def acquire(place: Context | int | None, user: object) -> Runtime:
    """Return the runtime of a place, started where there is none that is usable.

    Args:
        place: A context of the user's that is up. Or a ROS domain, or `None` for the one that the
            environment names: that is in a context of our own.
        user: The object that `release` is called with later; the runtime lives until then at least.

    Raises:
        ValueError: The environment names no domain, or rcl refuses the arguments of the process.
    """
    place = environment_domain() if place is None else place
    while True:
        runtime = _usable_runtime(place)
        try:
            if runtime.run(partial(runtime.add_user, user)):
                return runtime
        except BaseException:  # also for a Ctrl-C: nobody would call `release`
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
    """Give back a runtime. It ends when its last user gives it back."""
    runtime.run(partial(runtime.remove_user, user))


def join_ending(timeout: float, *, at_once: bool = False) -> None:
    """Wait for the threads that were told to end, those that keep their node included.

    Args:
        timeout: Seconds.
        at_once: Whether they keep it no longer: a human does not want to wait for that.
    """
    until = time.monotonic() + timeout
    for runtime in list(_registry.ending):
        if at_once:
            runtime.keep_no_longer()
        runtime.join(until - time.monotonic())


def end_all(timeout: float, *, at_once: bool = False) -> None:
    """End all threads at the interpreter's exit, and wait for them as `join_ending` does.

    One that is still in use belongs to a client that was interrupted while it was made.
    """
    for runtime in list(_registry.by_place.values()):
        runtime.call_soon(runtime.end)
        _registry.ending.add(runtime)
    join_ending(timeout, at_once=at_once)


def forget_inherited() -> None:
    """Begin without runtimes in a process that was forked: its parent's cannot be used (R20)."""
    # The lock is new too: a thread that does not exist here may have held it.
    kept = _Registry()
    kept.by_place = _registry.by_place
    _inherited.append(kept)
    _registry.__init__()  # type: ignore[misc]

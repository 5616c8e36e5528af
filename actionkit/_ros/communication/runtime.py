"""Runs the communication thread: one for all clients of a context.

The thread owns a node of ActionKit, all DDS entities on it, and the timers. It does not spin the
user's nodes, and never calls a function of the user.

If the user has a context, the node is in it, and uses its domain, discovery, security, middleware
settings and participant. Otherwise the context is ours. The context also becomes ours after a
standstill, if servers do not find the participant's subscriptions any more: the user's other nodes
keep the old participant.

A user's context may be shut down at any time, by `rclpy.shutdown()` or by the signal handler of
`rclpy.init()`, which shuts down every context of the process (R10). Existing entities go on working
(see `wait_set`): a cancel request still reaches the server, and its answer wakes this thread. But
the graph does not work any more, and nothing new can be made. So new clients get a new runtime.
"""

from __future__ import annotations

import itertools
import logging
import os
import threading
import time
from collections import deque
from collections.abc import Callable
from functools import partial
from typing import Any, TypeVar, cast
from weakref import WeakValueDictionary

from rclpy.context import Context
from rclpy.node import Node

from actionkit._ros.communication.outbox import Window
from actionkit._ros.communication.own_node import leave_graph, make_node, start
from actionkit._ros.endpoints import graph
from actionkit._ros.rclpy_private.native import domain_of, is_up, on_shutdown, shut_down
from actionkit._ros.rclpy_private.wait_set import SOURCES_OF_A_CLIENT, Source, Waiter
from actionkit._ros.workarounds.node_replacement import NodeReplacement
from actionkit._ros.workarounds.standstill import Standstill
from actionkit._threads.clock import TimerQueue
from actionkit._threads.diagnostics import log_later, log_own_error
from actionkit._threads.waiting import Flag, taken_from

_T = TypeVar("_T")
_W = TypeVar("_W", bound=Window)
_START_TIMEOUT = 30.0
"""Seconds for the thread to start, or to begin with a function. Normally that takes milliseconds,
on an overloaded machine seconds. Without a limit, a broken middleware would block the caller."""
_LAST_STEP = 0.5
"""Seconds for a thread that has nothing more to do to end; it takes microseconds."""
_CONTEXTS_DOWN_WITHIN = (0.0, 0.01, 0.1, 1.0)
"""Seconds after which to check whether rclpy's signal handler has shut down the contexts. It first
wakes all waits, then needs microseconds for the contexts; the user's may come after ours."""
_numbers = itertools.count(1)
"""For the names of the nodes, which must be unique in a process."""


class Runtime:
    """One communication thread with its node."""

    def __init__(
        self,
        place: Context | int,
        on_last: Callable[[Runtime], None],
        *,
        apart: bool = False,
    ) -> None:
        """Start the thread; errors of rclpy for the context or the node go to the caller.

        Args:
            place: A context of the user, or a ROS domain: then the context is ours.
            on_last: Called on the thread when its last user is removed, and before it ends.
            apart: Whether to have our own participant even if there is a context of the user.
        """
        self.timers = TimerQueue()
        self.call_at = self.timers.arm
        """Call a callback on the thread at a monotonic time."""
        self.cancel_timer = self.timers.cancel
        """Cancel a call of `call_at`."""
        self.failure: BaseException | None = None
        """The error that ended the thread; `None` while it runs, and after an orderly end."""
        self.names_in_use: list[tuple[str, str]] = []
        """The action names and types of the clients here, each once."""
        self._windows: WeakValueDictionary[tuple[type, str], Any] = WeakValueDictionary()
        self.on_failure: list[Callable[[BaseException], None]] = []
        self.on_shutdown: list[Callable[[], None]] = []
        """These are called on the thread, several times, if the context is shut down (R10)."""
        self.in_graph_since = 0.0
        """When the node was made, in monotonic seconds. It needs time to discover the others."""
        self.was_shut_down = False
        """Whether they were called, or are being called."""
        self._pid = os.getpid()
        self.place = place
        """A context of the user, or a ROS domain."""
        self.context = place if isinstance(place, Context) else Context()
        """If this context is shut down, the runtime ends."""
        self._domain_id = domain_of(place) if isinstance(place, Context) else place
        self._own_context: Context | None = self.context
        """Where the node is; `None` if it is in the user's context, beside the user's nodes."""
        if isinstance(place, Context):
            self._own_context = Context() if apart else None
        self._inbox: deque[Callable[[], None]] = deque()
        self._sources: dict[Source, None] = {}
        self._waited_for: tuple[Source, ...] | None = None  # for `wait`; `None` after a change
        self._stopping = False
        self._keep_until = 0.0
        self._users: set[object] = set()
        self._node_name = f"actionkit_{os.getpid()}_{next(_numbers)}"
        self._broken: Exception | None = None
        self.node_replacement = NodeReplacement(
            self,
            can_leave=lambda links: self._can_leave(links) and self._owns_participant,
            is_alone=lambda: graph.is_alone(self.node),
            renew=self._renew_node,
            on_failure=self._on_rejoin_failure,
        )
        self.standstill = Standstill(
            self,
            self.node_replacement.links,
            can_leave=lambda: self._can_leave(len(self.node_replacement.links)),
            replace_node=self.node_replacement.replace_node,
        )
        self._on_last = on_last
        self._started = Flag()
        self._refused: BaseException | None = None
        self._closed = False
        """Whether the thread has ended, or will end without looking into the inbox again."""
        self._ended = Flag()
        self._thread = threading.Thread(target=self._main, name="actionkit", daemon=True)
        try:
            self._thread.start()
            if not self._started.wait(_START_TIMEOUT):
                raise TimeoutError(f"ActionKit's node did not come up in {_START_TIMEOUT:g} s")
        except BaseException:  # also after Ctrl-C: no thread is left behind
            self._stopping = True
            raise
        if self._refused is not None:
            raise self._refused

    # --- from any thread -------------------------------------------------------------------

    @property
    def usable(self) -> bool:
        """Whether new clients can be made here."""
        return (
            self._pid == os.getpid()
            and self.failure is None
            and not self._stopping
            and is_up(self.context)
        )

    @property
    def own_context(self) -> Context | None:
        """The context of the node if it is ours, not one of the user's."""
        return self._own_context

    @property
    def is_apart(self) -> bool:
        """Whether the node is in a context of ours although the user has a context."""
        return self._own_context not in (None, self.context)

    @property
    def in_thread(self) -> bool:
        """Whether the caller is on the communication thread."""
        return threading.current_thread() is self._thread

    def call_soon(self, callback: Callable[[], None]) -> None:
        """Call `callback` on the communication thread; calls keep their order.

        After the end of that thread it is called on this one, because no other thread would do it.
        """
        if self.in_thread:
            self._inbox.append(callback)
            return
        self._waiter.wake_with(self._inbox, callback)
        if self._closed:
            self._empty_inbox()

    def run(self, function: Callable[[], _T]) -> _T:
        """Call `function` on the communication thread and return what it returns.

        Raises:
            Exception: Anything that `function` raises.
            TimeoutError: The thread has not called it within half a minute.
        """
        if self.in_thread:
            return function()
        answers: list[_T] = []
        errors: list[BaseException] = []
        done = Flag()

        def call() -> None:
            try:
                answers.append(function())
            except BaseException as error:  # noqa: BLE001  handed to the caller
                errors.append(error)
            done.set()

        self.call_soon(call)
        if not done.wait(_START_TIMEOUT):
            raise TimeoutError(f"ActionKit's thread did not answer in {_START_TIMEOUT:g} s")
        for error in errors:
            raise error
        return answers[0]

    def join_if_stopping(self, timeout: float) -> None:
        """Wait for the thread if it is ending, unless it keeps its node (see `keep_until`)."""
        if self._stopping and self._keep_until <= time.monotonic():
            self.join(timeout)

    def join(self, timeout: float) -> None:
        """Wait for the thread to end. Does nothing on that thread itself."""
        if not self.in_thread and self._ended.wait(timeout):
            # Before Python 3.13 it takes a lock, which a signal handler must not wait for. So it
            # is called only when it returns at once.
            self._thread.join(_LAST_STEP)

    # --- on the communication thread -------------------------------------------------------

    def add_user(self, user: object) -> bool:
        """Keep the thread running for `user`, too; return `False` if it is ending already."""
        if self._stopping or self._closed:
            return False
        self._users.add(user)
        return True

    def remove_user(self, user: object) -> None:
        """Undo `add_user`. Without users the thread destroys node and context, and ends."""
        self._users.discard(user)
        if not self._users and not self._stopping:
            self._on_last(self)
            self._stopping = True

    def end(self) -> None:
        """End also where somebody still uses the thread."""
        for link in list(self.node_replacement.links):
            link.close()
        self._users.clear()
        self.remove_user(None)

    def window(self, kind: type[_W], action_name: str) -> _W:
        """Return the window for requests of one kind that all clients of an action here share."""
        # Not setdefault: no strong reference would keep a new window alive.
        window = self._windows.get((kind, action_name))
        if window is None:
            window = self._windows[kind, action_name] = kind()
        return cast(_W, window)

    def expect_more(self) -> None:
        """Make room for one more client or reader of a topic, as none can be made after a shutdown.

        Raises:
            RCLError: The context was shut down.
        """
        most = SOURCES_OF_A_CLIENT * (len(self.node_replacement.links) + 1) + len(self._sources)
        if most > self._waiter.room:
            self._waiter.make_room(2 * most)

    now = staticmethod(time.monotonic)
    """Monotonic seconds. Simulated time does not matter here (R23)."""

    def enable(self, source: Source) -> None:
        """Wait for `source` from now on."""
        if source not in self._sources:
            self._sources[source] = None
            self._waited_for = None

    def disable(self, source: Source) -> None:
        """Do not wait for `source`."""
        if source in self._sources:
            del self._sources[source]
            self._waited_for = None

    def keep_until(self, at: float) -> None:
        """Do not destroy the node before the monotonic time `at`.

        Fast DDS shares memory, with locks in it, with all processes on the machine. If a process is
        stopped or killed while it holds such a lock, the lock stays locked. A few seconds later the
        others notice that and replace the memory. If a participant is destroyed in the meantime,
        Fast DDS 2.14 waits for the lock in the memory that is being removed, and crashes. (This
        happened to 1 of 100 clients that were closed half a second after their server was stopped.)
        """
        self._keep_until = max(self._keep_until, at)

    def keep_no_longer(self) -> None:
        """Undo `keep_until`. From any thread."""
        self._keep_until = 0.0
        self._waiter.wake()

    def _main(self) -> None:
        try:
            self._open()
        except BaseException as error:  # noqa: BLE001  raised in the constructor's thread
            self._refused = error
            self._started.set()
            return
        self._started.set()
        try:
            while not self._stopping:
                self._turn()
            self._close()
        except BaseException as error:  # noqa: BLE001  a thread that dies must say so
            self.failure = error
            log_later(logging.CRITICAL, "the communication thread of ActionKit died", exc_info=True)
            for callback in list(self.on_failure):
                self._guarded(partial(callback, error))
        self._closed = True
        self._empty_inbox()  # others may have added to it before they saw `_closed`
        self._ended.set()

    def _open(self) -> None:
        if self._own_context is not None:
            start(self._own_context, self._domain_id)
        try:
            self._waiter = Waiter(self.context)
            self._make_node()
            on_shutdown(self.context, self._on_shutdown)
        except BaseException:  # no context is left behind
            self._leave_context()
            raise

    def _on_shutdown(self) -> None:
        self.call_soon(self._look_at_context)

    def _leave_context(self) -> None:
        if self._own_context is not None:
            shut_down(self._own_context)
            self._own_context.destroy()

    def _make_node(self) -> None:
        began, worked = time.monotonic(), time.thread_time()
        own = self._own_context
        self.node = make_node(self._node_name, own or self.context, own=own is not None)
        self.in_graph_since = time.monotonic()
        if self._owns_participant:
            self.node_replacement.joined(time.monotonic() - began, time.thread_time() - worked)

    @property
    def _owns_participant(self) -> bool:
        """Whether the participant ends with our node; nodes of the user would keep it."""
        return self._own_context is not None or graph.is_last(self.node)

    def _renew_node(self) -> Node:
        goes = self._owns_participant
        leave_graph(self.node)
        if not goes:
            context = Context()
            start(context, self._domain_id)
            self._own_context = context
        self._make_node()
        return self.node

    def _can_leave(self, links: int) -> bool:
        # The command line's tools, and a client that is being made, use the node without a link.
        in_use = len(self._users) > links or self._keep_until > time.monotonic()
        return not in_use and is_up(self.context)

    def _on_rejoin_failure(self, error: Exception) -> None:
        self._sources.clear()
        self._waited_for = None
        if is_up(self.context):
            self._broken = error
        self._look_at_context()  # a signal handler may have shut it down just now (R10)

    def _turn(self) -> None:
        for _ in range(len(self._inbox)):
            self._guarded(self._inbox.popleft())
        while (due := self.timers.pop_due(time.monotonic())) is not None:
            self._guarded(due)
        if self._broken is not None:
            raise self._broken
        if self._stopping:
            return
        timeout = 0.0 if self._inbox else None
        next_due = self.timers.next_due()
        if timeout is None and next_due is not None:
            timeout = max(0.0, next_due - time.monotonic())
        if self._waited_for is None:
            self._waited_for = tuple(self._sources)
        ready = self._waiter.wait(self._waited_for, timeout)
        self.standstill.turn()  # before its results are read
        for source in ready:
            if source in self._sources:  # a callback for an earlier one may have disabled it
                self._guarded(source.on_readable)
        if self._waiter.signalled:
            for seconds in _CONTEXTS_DOWN_WITHIN:
                self.call_at(time.monotonic() + seconds, self._look_at_context)

    def _look_at_context(self) -> None:
        if not is_up(self.context):
            self.was_shut_down = True
            for callback in list(self.on_shutdown):
                self._guarded(callback)

    def _guarded(self, callback: Callable[[], None]) -> None:
        try:
            callback()
        except Exception:  # noqa: BLE001  an error in one goal must not end the thread (R8)
            log_own_error()

    def _empty_inbox(self) -> None:
        """Call what is in the inbox. After the thread's end any thread may do so."""
        for callback in taken_from(self._inbox):
            self._guarded(callback)

    def _close(self) -> None:
        self._empty_inbox()
        while (left := self._keep_until - time.monotonic()) > 0:
            self._waiter.wait((), left)
            self._empty_inbox()
        self._waiter.destroy()
        leave_graph(self.node)
        self._leave_context()

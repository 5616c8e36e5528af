"""Tracks the runs of one leaf and their goals, and gives them up.

No py_trees here. Nothing waits. Any thread may use it, also a signal handler or a garbage
collection: each change of shared data is one operation in C.
"""

from __future__ import annotations

import os
import time
from collections import deque
from collections.abc import Iterable
from contextlib import suppress
from typing import Any

from actionkit import Client, GoalFuture
from actionkit._internal_api import Classify, blocks_another, prepare_call
from actionkit._model.arguments import UNSET
from actionkit._model.errors import ClientClosedError
from actionkit._model.settings import RetryPolicy

AnyFuture = GoalFuture[Any, Any]


class Run:
    """One run of a leaf, from its first tick until it ends or is interrupted."""

    def __init__(self, timeout: float | None) -> None:
        """Begin a run. Its time starts now; it has no goal yet."""
        self.future: AnyFuture | None = None
        self.unwanted = False
        self.problem = ""
        """A sentence: why it fails without a goal."""
        self.deadline = None if timeout is None else time.monotonic() + timeout
        self.unknown_since: float | None = None
        """When it began to wait for an earlier goal in an unknown state."""
        self._client: Client[Any] | None = None
        self._tickets = deque([None])

    def start(
        self,
        client: Client[Any],
        goal: Any,
        retry: RetryPolicy | None,
        classify: Classify | None,
        preempts: Run | None = None,
        key: str | None = None,
    ) -> None:
        """Send the goal, unless it was sent already or the run was given up.

        `preempts` is an earlier run: the server stops its goal when it gets this one. `key` is that
        of `Client.call`.

        Raises:
            ClientClosedError: The client was closed.
            LedgerError, ValueError: As for `Client.call`.
            RuntimeError: This process was forked from the client's.
        """
        try:
            self._tickets.pop()
        except IndexError:
            return  # another thread also ticks this leaf, and was first
        left = UNSET if self.deadline is None else max(0.0, self.deadline - time.monotonic())
        self._client = client
        try:
            # Kept before the call begins, so that an interruption here cannot lose a goal.
            earlier = None if preempts is None else preempts.future
            self.future, begin = prepare_call(
                client, goal, left, retry, classify, preempts=earlier, key=key
            )
            if not self.unwanted:
                begin()
        except BaseException as error:
            if self.future is None or isinstance(error, ClientClosedError):
                self.future = None  # nothing has begun
            self.give_up()
            raise
        if self.unwanted:  # another thread may have set it just now
            self.future.cancel()

    def give_up(self) -> None:
        """Send no goal any more, and cancel the goal that was sent."""
        self.unwanted = True
        if self.future is not None and not self.future.done():
            self.future.cancel()

    @property
    def known_to_run(self) -> bool | None:
        """True if its goal is known to run, False if it is known not to run; else `None`."""
        unwanted = self.unwanted  # first: `start` checks it after setting `future`
        if self.future is None:
            return False if unwanted else None
        done = self.future.done()  # first: until then, another attempt may begin
        known = self.future.known_to_run
        if not done:
            return known or None
        client_watches = self._client is not None and not self._client.closed
        return known if client_watches or known is False else None

    def stops_for_another(self, client: Client[Any]) -> bool:
        """Whether a server that preempts stops its goal if that client sends it another one.

        If the goal was lost, the other one may reach another server only.
        """
        if self.future is None or self._client is not client:
            return False
        return not self.future.done() or self.future.known_to_run is True

    @property
    def holds_up(self) -> bool:
        """Whether no other run may send a goal beside this one.

        If the server has left the graph, its goal does not hold up other runs: that server may
        never be seen again, and if it is, the client cancels the goal. A server that is only silent
        may go on with its goal.
        """
        unwanted, future = self.unwanted, self.future  # in this order, as in `known_to_run`
        if future is None:
            return not unwanted
        return blocks_another(future, unless_gone=True, unless_unseen=True)


class Runs:
    """The runs of one leaf that may have a running goal. Holds no reference to the leaf."""

    def __init__(self) -> None:
        self._runs: deque[Run] = deque()
        self._pid = os.getpid()
        self.closed = False
        """Whether no run may start a goal any more."""

    def begin(self, timeout: float | None) -> Run:
        """Begin a run, and give up all others, also those that have sent nothing yet."""
        run = Run(timeout)
        # First, so that if two threads begin, at least one sees the other (C11.1).
        self._runs.append(run)
        self.give_up([each for each in list(self._runs) if each is not run])
        self.before(run)
        return run

    def before(self, run: Run) -> list[Run]:
        """Return the other runs that hold this run up; forget those that do not."""
        others = [each for each in list(self._runs) if each is not run]
        for each in others:
            if not each.holds_up:
                with suppress(ValueError):  # another thread did the same
                    self._runs.remove(each)
        return [each for each in others if each.holds_up]

    def give_up(self, runs: Iterable[Run] | None = None) -> None:
        """Cancel the goals of these runs, or of all."""
        if os.getpid() != self._pid:
            return  # a forked process: the goals belong to its parent
        for run in list(self._runs) if runs is None else runs:
            run.give_up()

    def close(self) -> None:
        """Start no more goals, and cancel the existing ones."""
        self.closed = True
        self.give_up()

    def in_flight(self) -> list[AnyFuture]:
        """Return the futures that are not done."""
        futures = [run.future for run in list(self._runs)]
        return [future for future in futures if future is not None and not future.done()]

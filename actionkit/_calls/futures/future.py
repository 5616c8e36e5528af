"""The future of one call: a `concurrent.futures.Future` that can also be awaited."""

from __future__ import annotations

import concurrent.futures
import logging
import os
import sys
from collections import deque
from collections.abc import Callable, Coroutine, Generator
from functools import partial
from typing import Any, Generic, cast

from typing_extensions import Never, Self

from actionkit._calls.awaiting.awaiters import Awaiters
from actionkit._calls.futures.call_view import CallIsOver, CallView, GoalsKeeper
from actionkit._calls.futures.feedback_broadcast import FeedbackBroadcast
from actionkit._calls.futures.goals_left import tell_of_goals_left
from actionkit._calls.futures.live_goal import LiveGoal
from actionkit._calls.on_signal.signals import is_ending
from actionkit._goal.effects import End
from actionkit._model.action_type import FeedbackT, ResultT
from actionkit._model.errors import ActionKitError, ClientClosedError
from actionkit._model.settings import check_seconds
from actionkit._model.values import GoalEvent, GoalState, Outcome
from actionkit._threads.diagnostics import is_interrupt, log_here, log_later
from actionkit._threads.in_hand import Label
from actionkit._threads.pool import Pool
from actionkit._threads.waiting import Flag, run_in_thread, taken_from

if sys.version_info >= (3, 11):
    LocalTimeout = TimeoutError
else:

    class LocalTimeout(TimeoutError, concurrent.futures.TimeoutError):
        """A local wait took too long. The two bases are one class from Python 3.11 on."""


_DONE_CALLBACKS = Label("done callbacks", None, "closing")
_NOT_YOURS = "GoalFuture.{}() is not for users: only its call ends a future. To give up, cancel()"


class GoalFuture(
    concurrent.futures.Future[ResultT],
    Coroutine[Any, Any, ResultT],
    LiveGoal[FeedbackT],
    Generic[ResultT, FeedbackT],
):
    """The future result of a call.

    It works with `concurrent.futures.wait`, `as_completed` and `add_done_callback`. It can be
    awaited under asyncio, under trio, and in callbacks that an executor of rclpy runs; asyncio
    also accepts it as a coroutine, as in `asyncio.create_task`. Make one by `Client.call_async`.

    If you drop it, the goal is not affected. A failure that nobody has looked at is then logged.

    In a signal handler, only call `cancel()`, read members such as `done()` and `state`, or raise.
    """

    # Set on the class, for `__del__`: Ctrl-C may interrupt the constructor.
    _outcome: Outcome[ResultT] | None = None
    _looked_at = False
    """Whether anybody asked how the call ended, or will be told."""

    def __init__(
        self,
        call: CallView,
        feedback: FeedbackBroadcast[FeedbackT],
        pool: Pool,
        session: GoalsKeeper,
    ) -> None:
        super().__init__()
        self._call = call
        self._feedback = feedback
        self._pool = pool
        self._cancelled = False
        self._over = Flag()
        self._answered = Flag()
        """Set when a server has accepted the goal, or the call is over."""
        self._acceptance: GoalEvent | None = None
        self._pid = os.getpid()
        self._user_callbacks: deque[Callable[[Any], object]] = deque()
        self._awaiters = Awaiters(self._over, session)
        self._session = session

    def __repr__(self) -> str:
        return f"<GoalFuture {self.goal_id} {self.state}{' done' if self.done() else ''}>"

    def __copy__(self) -> Self:
        return self  # there is only one call: a copy would never see its end

    def __deepcopy__(self, _: dict[int, Any]) -> Self:
        return self

    def __reduce__(self) -> Never:
        raise TypeError(
            "a GoalFuture cannot be pickled: wait in the process that called, and pickle the"
            " result or outcome()"
        )

    # --- waiting ---------------------------------------------------------------------------

    def result(self, timeout: float | None = None) -> ResultT:
        """Wait for the goal and return the action's result.

        Args:
            timeout: Seconds of this local wait; `None` means no limit. If they run out, the goal is
                not affected.

        Raises:
            TimeoutError: The local wait took too long.
            concurrent.futures.CancelledError: The goal was cancelled through this future.
            ActionKitError: The call failed; each subclass is one way to fail.
        """
        error = self._error(timeout)
        if error is not None:
            raise error
        assert self._outcome is not None
        return cast("ResultT", self._outcome.result)

    def exception(self, timeout: float | None = None) -> BaseException | None:
        """Wait for the goal and return what `result` would raise, or `None`.

        Args:
            timeout: The same as for `result`.

        Raises:
            TimeoutError: The local wait took too long.
            concurrent.futures.CancelledError: The goal was cancelled through this future.
        """
        error = self._error(timeout)
        if error is not None and self._cancelled:
            raise error
        return error

    def outcome(self, timeout: float | None = None) -> Outcome[ResultT]:
        """Wait for the goal and return all that is known about it; a failure is not raised.

        Args:
            timeout: The same as for `result`.

        Raises:
            TimeoutError: The local wait took too long.
        """
        self._error(timeout)
        assert self._outcome is not None
        return self._outcome

    def _error(self, timeout: float | None) -> BaseException | None:
        self._looked_at = True
        self._check_process()
        if not self._over.wait(timeout):
            raise LocalTimeout(
                f"the goal is still {self.state} after the local wait; it was not cancelled"
            )
        assert self._outcome is not None
        error = self._outcome.error
        # The error names the goals that may run. But when the program ends, the code that gets the
        # error usually ends, too, and nobody sees it.
        if error is not None and not (isinstance(error, ClientClosedError) or is_ending()):
            self._call.goals.tell()
        return error

    def wait_accepted(self, timeout: float | None = None) -> GoalEvent:
        """Wait until a server has accepted the goal, and return that event of the timeline.

        The event has the goal's id and the time. A retry does not change it. If the call succeeded,
        but the acceptance was never seen, this returns the last event.

        Args:
            timeout: The same as for `result`.

        Raises:
            TimeoutError: The local wait took too long; the goal is not affected.
            concurrent.futures.CancelledError: The goal was cancelled before it was accepted.
            ActionKitError: The call ended before that; `result` raises the same error.
        """
        self._check_process()
        self._answered.wait(timeout)
        return self._accepted_or_raise()

    async def wait_accepted_async(self, timeout: float | None = None) -> GoalEvent:
        """Like `wait_accepted`, but does not block the thread of this coroutine.

        It runs under asyncio, trio, or an executor of rclpy. If you cancel the waiting task, the
        goal is cancelled, unless another task awaits this future. `asyncio.timeout` does the same.
        If the goal must go on, use the timeout of this method. After the acceptance, nothing
        cancels the goal until you await the future. If your task ends before that, the goal runs to
        its deadline.

        Raises:
            RuntimeError: The coroutine runs under none of these three; the goal is cancelled.
        """
        seconds = check_seconds("timeout", timeout)
        self._check_process()
        was_cancelled = await self._awaiters.wait(
            self._give_up,
            self._tell_of_goals_left,
            self._call.cancel_grace,
            self._answered,
            seconds,
        )
        if self._acceptance is None and self.cancelled():
            raise was_cancelled(str(self._error(0)))
        return self._accepted_or_raise()

    def _accepted_or_raise(self) -> GoalEvent:
        if self._acceptance is not None:
            return self._acceptance
        if not self.done():
            raise LocalTimeout("no server accepted the goal within the local wait")
        self.result(0)  # raises, unless a goal that was lost turned out to have succeeded
        return self.timeline[-1]

    def done(self) -> bool:
        """Whether the call is over."""
        return self._over.is_set()

    def cancelled(self) -> bool:
        """Whether the call is over because the goal was cancelled through this future."""
        return self._cancelled and self.done()

    def __await__(self) -> Generator[Any, None, ResultT]:
        """Wait without polling and without blocking the thread of this coroutine.

        Cancelling the waiting task cancels the goal on the server. The task then waits for the
        confirmation, for at most `Timeouts.cancel` seconds, before it ends. If the goal may run on,
        the error's last argument and a warning in the log name it. If several tasks wait for one
        goal, only the last task that is cancelled cancels the goal.

        Raises:
            RuntimeError: The coroutine runs under nothing that can wait; the goal is cancelled.
        """
        return self._wait_async().__await__()

    async def _wait_async(self) -> ResultT:
        self._looked_at = True
        self._check_process()
        was_cancelled = await self._awaiters.wait(
            self._give_up, self._tell_of_goals_left, self._call.cancel_grace
        )
        if self.cancelled():
            raise was_cancelled(str(self._error(0)))
        return self.result(0)

    def _give_up(self) -> bool:
        """Cancel the goal, because nobody awaits it any more; return whether that was done."""
        # A forked child also closes the coroutines it inherited.
        if os.getpid() != self._pid or self._call.left_alone:
            return False
        return self.cancel()

    def _tell_of_goals_left(self, error: BaseException) -> None:
        """Add the goals that may run to the error that ended a wait, and warn of them."""
        tell_of_goals_left(error, self._session.action_name, self._call.goals)

    # Asyncio calls these if this is a task's coroutine, as in `asyncio.create_task(future)`.

    def send(self, value: Any) -> Any:
        """Resume the running task of asyncio; this is its coroutine."""
        return self._awaiters.send(self._wait_async, value)

    def throw(self, typ: Any, val: Any = None, tb: Any = None) -> Any:
        """Raise an error in the running task of asyncio; this is its coroutine."""
        return self._awaiters.throw(self._wait_async, typ if val is None else val)

    def close(self) -> None:
        """Cancel the goal if nobody awaits it. Asyncio calls this if it rejects the future."""
        self._awaiters.close(self._give_up)

    # --- control ---------------------------------------------------------------------------

    def cancel(self) -> bool:
        """Ask to cancel the goal. Never blocks; you may call it at any time.

        If the goal was not sent yet, it is never sent. Otherwise the server is asked. The future
        then ends with what happened to the goal: with `CancelledError` if it was cancelled, or with
        the result if it succeeded first. If the server refuses, the goal goes on, and the future
        stays pending. If no answer comes, the future ends after `Timeouts.cancel` seconds with a
        `DeadlineExceededError` of the phase `"cancel"`.

        If the call is over and its goal may still run, the server is asked again. The future does
        not change then; `known_to_run` tells when the goal has stopped. Nothing is asked if the
        goal was left to run, or if another call has attached to it: then that call decides.

        Returns:
            `True` if the call was not over, or if this future was cancelled before; `False` if the
            call ended in another way.
        """
        self._check_process()
        over = self.done()
        self._call.request_cancel()
        return self.cancelled() if over else True

    def running(self) -> bool:
        """Whether the goal was sent and the call is not over."""
        return not self.done() and self.state is not GoalState.SENDING

    def add_done_callback(self, fn: Callable[[Any], object]) -> None:
        """Call `fn` with this future when it is done, on one of ActionKit's threads.

        If it is done already, call `fn` now, on this thread. An error that `fn` raises is logged.
        """
        self._looked_at = True
        if self.done():
            self._call_back(fn)
            return
        self._user_callbacks.append(fn)
        if self.done():  # it ended before `fn` could be seen
            for late in taken_from(self._user_callbacks):
                self._call_back(late)

    def _call_back(self, fn: Callable[[Any], object]) -> None:
        try:
            fn(self)
        except BaseException as error:  # the other callbacks must be called, too
            if is_interrupt(error):
                raise
            log_here(
                logging.ERROR, "a done callback of goal %s raised", self.goal_id, exc_info=True
            )

    def set_result(self, result: ResultT) -> Never:
        """Refuse: only the call can end its future.

        Raises:
            RuntimeError: Always.
        """
        raise RuntimeError(_NOT_YOURS.format("set_result"))

    def set_exception(self, exception: BaseException | None) -> Never:
        """Refuse, like `set_result`.

        Raises:
            RuntimeError: Always.
        """
        raise RuntimeError(_NOT_YOURS.format("set_exception"))

    def set_running_or_notify_cancel(self) -> Never:
        """Refuse, like `set_result`.

        Raises:
            RuntimeError: Always.
        """
        raise RuntimeError(_NOT_YOURS.format("set_running_or_notify_cancel"))

    def __del__(self) -> None:
        """Log a failure that nobody has looked at. Any thread may drop the future."""
        if self._looked_at or self._outcome is None:
            return
        error = self._outcome.error
        if isinstance(error, ActionKitError) and not isinstance(error, ClientClosedError):
            text = "a call failed, and nobody asked its future how it ended: %s"
            log_later(logging.ERROR, text, str(error))

    # --- for the call only -----------------------------------------------------------------

    def _is_of(self, session: object) -> bool:
        """Whether the call is one of this session, which has its thread."""
        return self._session is session

    def _accept(self, event: GoalEvent) -> None:
        """Tell that a server has accepted a goal. On the communication thread. Never blocks."""
        if self._acceptance is None:
            self._acceptance = event
            self._answered.set()

    def _settle(
        self,
        outcome: Outcome[ResultT],
        end: End,
        count_out: Callable[[], object] = lambda: None,
    ) -> None:
        """End the future. On the communication thread, once. Never blocks.

        `count_out` releases the call, so that closing does not wait for it any more.
        """
        # Closing must wait for the done callbacks before it can see that the call is over.
        dues = self._pool.dues
        due = dues.begin(_DONE_CALLBACKS) if self._user_callbacks else None
        count_out()
        self._outcome = outcome
        self._cancelled = end in (End.CANCELLED_BY_CALLER, End.REPLACED)
        call = self._call
        self._call = CallIsOver(
            call.goals.left(),
            call.goal_id,
            call.state,
            call.timeline,
            call.cancel_grace,
            call.to_replace,
            self._session,
        )
        notified = self._notify_base_at_once()
        self._over.set()
        self._answered.set()
        if not notified:
            run_in_thread(self._notify_base)
        for callback in taken_from(self._user_callbacks):
            label = Label("done callback", callback, "one of its client's threads for callbacks")
            self._pool.submit(partial(self._call_back, callback), label)
        if due is not None:
            dues.done(due)
        self._pool.look()  # a callback may still be busy with this call's feedback

    def _wait_until_over(self, seconds: float) -> bool:
        """Wait for at most so many seconds; return whether the call is over."""
        return self._over.wait(seconds)

    # What follows is only for `concurrent.futures.wait` and `as_completed`. They take locks, also
    # in the main thread, where a signal handler may close the client at that moment. So the
    # communication thread never waits for these locks, and nothing else depends on them.

    def _notify_base_at_once(self) -> bool:
        """End the future of the base class if that needs no waiting; return whether it did."""
        if not self._condition.acquire(blocking=False):
            return False
        try:
            if not self._waiters:  # they have locks, too
                self._notify_base()
                return True
            return False
        finally:
            self._condition.release()

    def _notify_base(self) -> None:
        outcome = self._outcome
        assert outcome is not None
        if self._cancelled:
            super().cancel()
            super().set_running_or_notify_cancel()
        elif outcome.error is not None:
            super().set_exception(outcome.error)
        else:
            super().set_result(cast("ResultT", outcome.result))

    def _check_process(self) -> None:
        if os.getpid() != self._pid:
            raise RuntimeError(
                f"this GoalFuture belongs to process {self._pid}; its goal cannot be followed in"
                f" process {os.getpid()}, which was forked from it. Wait for it there, or call"
                " with a Client that was made here"
            )

"""The handle on one call: a `concurrent.futures.Future` that can also be awaited."""

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

from actionkit._calls.awaiting import Awaiters
from actionkit._calls.call_view import CallIsOver, CallView
from actionkit._calls.feedback_broadcast import FeedbackBroadcast
from actionkit._calls.live_goal import LiveGoal
from actionkit._calls.signals import is_ending
from actionkit._goal.effects import End
from actionkit._model.action_type import FeedbackT, ResultT
from actionkit._model.arguments import refuse_unknown
from actionkit._model.errors import ActionKitError, ClientClosedError
from actionkit._model.values import GoalState, Outcome
from actionkit._threads.diagnostics import is_interrupt, log_here, log_later
from actionkit._threads.function_runner import Clock
from actionkit._threads.in_hand import Label
from actionkit._threads.pool import Pool
from actionkit._threads.waiting import Flag, run_in_thread, taken_from

if sys.version_info >= (3, 11):
    LocalTimeout = TimeoutError
else:

    class LocalTimeout(TimeoutError, concurrent.futures.TimeoutError):
        """A local wait ran out. The two bases are one class from Python 3.11 on."""


_DONE_CALLBACKS = Label("done callbacks", None, "closing")
_NOT_YOURS = "GoalFuture.{}() is not for users: only its call ends a future. To give up, cancel()"


class GoalFuture(
    concurrent.futures.Future[ResultT],
    Coroutine[Any, Any, ResultT],
    LiveGoal[FeedbackT],
    Generic[ResultT, FeedbackT],
):
    """The result that a call will have.

    Works with `concurrent.futures.wait`, `as_completed` and `add_done_callback`, and can be
    awaited under asyncio, under trio, and in callbacks that an executor of rclpy runs; asyncio
    takes it for a coroutine, too, as in `asyncio.create_task`. Made by `Client.call_async` only.

    Dropping it leaves the goal alone. A failure that nobody has looked at then is logged.

    In a signal handler use only `cancel()` and what reads, such as `done()` and `state`, or raise.
    """

    # Already here, for `__del__`: Ctrl-C may interrupt the constructor.
    _outcome: Outcome[ResultT] | None = None
    _looked_at = False
    """Whether anybody asked how the call ended, or will be told."""

    def __init__(
        self,
        call: CallView,
        feedback: FeedbackBroadcast[FeedbackT],
        pool: Pool,
        clock: Clock,
    ) -> None:
        super().__init__()
        self._call = call
        self._feedback = feedback
        self._pool = pool
        self._cancelled = False
        self._over = Flag()
        self._pid = os.getpid()
        self._user_callbacks: deque[Callable[[Any], object]] = deque()
        self._awaiters = Awaiters(self._over, clock)

    def __repr__(self) -> str:
        return f"<GoalFuture {self.goal_id} {self.state}{' done' if self.done() else ''}>"

    def __copy__(self) -> Self:
        return self  # the call is one: a copy would never hear of its end

    def __deepcopy__(self, _: dict[int, Any]) -> Self:
        return self

    # --- waiting ---------------------------------------------------------------------------

    def result(self, timeout: float | None = None, **unknown: Never) -> ResultT:
        """Wait for the goal and return the action's result.

        Args:
            timeout: Seconds of this local wait, `None` for no limit. When they run out the
                goal is left alone.

        Raises:
            TimeoutError: The local wait ran out.
            concurrent.futures.CancelledError: The goal was cancelled through this future.
            ActionKitError: The call failed; each subclass is one way to fail.
        """
        refuse_unknown(unknown, self.result)
        error = self._error(timeout)
        if error is not None:
            raise error
        assert self._outcome is not None
        return cast("ResultT", self._outcome.result)

    def exception(self, timeout: float | None = None, **unknown: Never) -> BaseException | None:
        """Wait for the goal and return what `result` would raise, or `None`.

        Args:
            timeout: As for `result`.

        Raises:
            TimeoutError: The local wait ran out.
            concurrent.futures.CancelledError: The goal was cancelled through this future.
        """
        refuse_unknown(unknown, self.exception)
        error = self._error(timeout)
        if error is not None and self._cancelled:
            raise error
        return error

    def outcome(self, timeout: float | None = None, **unknown: Never) -> Outcome[ResultT]:
        """Wait for the goal and return all that is known of it; a failure is not raised.

        Args:
            timeout: As for `result`.

        Raises:
            TimeoutError: The local wait ran out.
        """
        refuse_unknown(unknown, self.outcome)
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
        # The error names the goals that may run. But where the program ends, what gets the error is
        # most often over itself, and nobody sees it.
        if error is not None and not (isinstance(error, ClientClosedError) or is_ending()):
            self._call.goals.tell()
        return error

    def done(self) -> bool:
        """Whether the call is over."""
        return self._over.is_set()

    def cancelled(self) -> bool:
        """Whether the call is over because the goal was cancelled through this future."""
        return self._cancelled and self.done()

    def __await__(self) -> Generator[Any, None, ResultT]:
        """Wait without polling and without blocking what runs this coroutine.

        Cancelling the task that waits cancels the goal on the server, waits for that to be
        confirmed, `Timeouts.cancel` seconds at most, and lets the cancellation go on. Where
        several tasks wait for one goal, only the last of them to be cancelled cancels it.

        Raises:
            RuntimeError: Nothing runs this coroutine that could wait; the goal is cancelled.
        """
        return self._wait_async().__await__()

    async def _wait_async(self) -> ResultT:
        self._looked_at = True
        self._check_process()
        was_cancelled = await self._awaiters.wait(self._give_up, self._call.cancel_grace)
        if self.cancelled():
            raise was_cancelled(f"goal {self.goal_id} was cancelled")
        return self.result(0)

    def _give_up(self) -> None:
        """Cancel the goal, because nobody awaits it any more."""
        if os.getpid() == self._pid:  # in a forked child coroutines are cleared away as well
            self.cancel()

    # Asyncio calls these where this is a task's coroutine, as in `asyncio.create_task(future)`.

    def send(self, value: Any) -> Any:
        """Go on with the running task of asyncio; this is its coroutine."""
        return self._awaiters.send(self._wait_async, value)

    def throw(self, typ: Any, val: Any = None, tb: Any = None) -> Any:
        """Raise an error in the running task of asyncio; this is its coroutine."""
        return self._awaiters.throw(self._wait_async, typ if val is None else val)

    def close(self) -> None:
        """Cancel the goal if nobody awaits it: asyncio has refused to make a task of this."""
        self._awaiters.close(self._give_up)

    # --- control ---------------------------------------------------------------------------

    def cancel(self) -> bool:
        """Ask for the goal to be cancelled; never blocks, safe at any time.

        A goal that was not sent yet is never sent. Otherwise the server is asked, and the
        future ends with what happened to the goal: `CancelledError` if it was cancelled, the
        result if it succeeded all the same. If the server refuses, the goal runs on and so does
        the future. Without an answer it ends after `Timeouts.cancel` seconds with a
        `DeadlineExceededError` of the phase `"cancel"`.

        Returns:
            Whether the request was made: `False` when the call is over.
        """
        self._check_process()
        if self.done():
            return self.cancelled()
        self._call.request_cancel()
        return True

    def running(self) -> bool:
        """Whether the goal was sent and the call is not over."""
        return not self.done() and self.state is not GoalState.SENDING

    def add_done_callback(self, fn: Callable[[Any], object]) -> None:
        """Call `fn` with this future when it is done, on a thread of ActionKit's.

        At once and on this thread where it is done already. What `fn` raises is logged.
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
        except BaseException as error:  # the other callbacks are called all the same
            if is_interrupt(error):
                raise
            log_here(
                logging.ERROR, "a done callback of goal %s raised", self.goal_id, exc_info=True
            )

    def set_result(self, result: ResultT) -> Never:
        """Refuse: only its call can end a future.

        Raises:
            RuntimeError: Always.
        """
        raise RuntimeError(_NOT_YOURS.format("set_result"))

    def set_exception(self, exception: BaseException | None) -> Never:
        """Refuse, as `set_result`.

        Raises:
            RuntimeError: Always.
        """
        raise RuntimeError(_NOT_YOURS.format("set_exception"))

    def set_running_or_notify_cancel(self) -> Never:
        """Refuse, as `set_result`.

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

    def _settle(
        self,
        outcome: Outcome[ResultT],
        end: End,
        count_out: Callable[[], object] = lambda: None,
    ) -> None:
        """End the call. On the communication thread, once. Never blocks.

        Args:
            outcome: What is told of the call.
            end: How it ended.
            count_out: Lets go of the call, so that closing does not wait for it any more.
        """
        # Closing waits for the done callbacks from now on: before it can see that the call is over.
        dues = self._pool.dues
        due = dues.begin(_DONE_CALLBACKS) if self._user_callbacks else None
        count_out()
        self._outcome = outcome
        self._cancelled = end is End.CANCELLED_BY_CALLER
        call = self._call
        self._call = CallIsOver(
            call.goals.left(), call.goal_id, call.state, call.timeline, call.cancel_grace
        )
        notified = self._notify_base_at_once()
        self._over.set()
        if not notified:
            run_in_thread(self._notify_base)
        for callback in taken_from(self._user_callbacks):
            label = Label("done callback", callback, "one of its client's threads for callbacks")
            self._pool.submit(partial(self._call_back, callback), label)
        if due is not None:
            dues.done(due)
        self._pool.look()  # a callback may still be at this call's feedback

    def _wait_until_over(self, seconds: float) -> bool:
        """Wait so long at most; return whether the call is over."""
        return self._over.wait(seconds)

    # What follows is for `concurrent.futures.wait` and `as_completed` alone. They take locks, in
    # the main thread too, where a signal handler may close the client meanwhile: so the
    # communication thread never waits for these locks, and nothing else rests on them.

    def _notify_base_at_once(self) -> bool:
        """End the future of the base class if that needs no waiting; return whether it did."""
        if not self._condition.acquire(blocking=False):
            return False
        try:
            if not self._waiters:  # these have locks too
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
                "this GoalFuture belongs to the process that was forked; its goal cannot be"
                " followed here"
            )

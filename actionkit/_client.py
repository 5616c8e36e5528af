"""The client: typed methods that check their arguments and hand over to a session."""

from __future__ import annotations

import uuid
import weakref
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from types import TracebackType
from typing import TYPE_CHECKING, Any, Generic, Literal

from typing_extensions import Never, Self

from actionkit._calls.awaiting.blocking_guards import refuse_in_callback, warn_on_event_loop
from actionkit._calls.awaiting.drivers import in_thread
from actionkit._calls.cancel_everything import cancel_everything
from actionkit._calls.ending.closing import close, end_interrupted
from actionkit._calls.errors.explain import invalid_goal
from actionkit._calls.futures.feedback import callbacks_for
from actionkit._calls.futures.future import GoalFuture
from actionkit._calls.ledger.chosen import ledger_of
from actionkit._calls.retries.budget import RetryBudget, check_budget
from actionkit._calls.retries.classify import Classify, check_classify
from actionkit._calls.sending.call import Call
from actionkit._calls.sending.replacing import check_replaces
from actionkit._calls.sending.request import Request
from actionkit._calls.transport import transport
from actionkit._messages.convert import from_plain
from actionkit._model.action_type import ActionT_co, ActionType, FeedbackT, GoalT, ResultT
from actionkit._model.arguments import UNSET, Unset, check_type
from actionkit._model.field_errors import FieldError, FieldTypeError
from actionkit._model.goal_ids import goal_id_of
from actionkit._model.settings import RetryPolicy, Timeouts, check_seconds
from actionkit._model.values import CancelReport
from actionkit._observers.protocol import Observer, check_observers
from actionkit._threads.function_runner import function_pool

if TYPE_CHECKING:
    from actionkit._calls.ledger.file import LedgerFile
    from actionkit._calls.sending.session import OnClose, Session


class Client(Generic[ActionT_co]):
    """Calls the goals of one action.

        with Client(Fibonacci, "fibonacci") as client:
            result = client.call(Fibonacci.Goal(order=10), timeout=10.0)

    In an annotation it is a `Client[Fibonacci]`.

    It needs no `rclpy.init()`, node, executor or thread of yours. If you have any, it does not
    spin, shut down or block them. You can use it in any thread and in any callback. In a signal
    handler, use only `cancel_all()`, `close()` and what reads a state, or raise.
    """

    def __init__(
        self,
        action_type: type[ActionT_co],
        action_name: str,
        *,
        node: Any = None,
        timeouts: Timeouts = Timeouts(),  # noqa: B008  frozen
        retry: RetryPolicy = RetryPolicy(),  # noqa: B008  frozen
        classify: Classify | None = None,
        observers: Iterable[Observer] = (),
        on_close: OnClose = "cancel",
        retry_budget: RetryBudget | None = None,
        ledger: LedgerFile | None = None,
    ) -> None:
        """Make a client. Does not wait for a server.

        Args:
            action_type: The action's class, such as `test_msgs.action.Fibonacci`.
            action_name: The action's name, relative or absolute.
            node: A node of yours. Its namespace, remaps and ROS domain apply to the action's name,
                and logs have its name. The client does not spin or change it.
            timeouts: Limits for the phases of each call.
            retry: When a call is tried again after a failure that may pass.
            classify: A function `(Outcome) -> Verdict | None`. It decides whether a goal that a
                server ended or rejected counts as a success; `None` leaves the default. It runs on
                a thread of its own, and has until the call's deadline, 10 seconds at most. If it
                raises, does not answer or returns something else, a goal that succeeded fails with
                a `ClassifyError`, and a goal that failed keeps its own error. A goal that was
                rejected or canceled, or that failed without a result, cannot be called a success:
                that is a `ClassifyError`, too. Ready-made: `classify_by_field`, `retry_aborted`.
            observers: Objects that get each transition: `JsonLines`, `Rosout`, `OpenTelemetry`, or
                your own.
            on_close: What closing does to goals in flight: `"cancel"` or `"abandon"`.
            retry_budget: A limit on retries, which several clients can share. By default the client
                has its own.
            ledger: A `Ledger`. Goals are written down there before they are sent. By default it is
                the file that the environment variable `ACTIONKIT_LEDGER` names, if it is set.

        Raises:
            TypeError: An argument of the wrong type, `action_type` and `node` included.
            ValueError: A bad name or `on_close`, or the same observer twice; a node that was
                destroyed, or one with a context that was shut down; arguments of the process, or a
                `ROS_DOMAIN_ID`, that ROS refuses.
            ImportError: rclpy is not importable.
            RuntimeError: gevent or eventlet has replaced Python's threads; or a test of this
                process has a ROS domain for itself (`ros_domain`, `isolated_domain`), which is not
                the client's.
            ActionTypeMismatchError: This process already uses the name with another type.
            SecurityError: ROS security (SROS 2) is on, and keeps this process or the action out.
            LedgerError: The ledger's file cannot be used.
        """
        check_type("timeouts", timeouts, Timeouts)
        check_type("retry", retry, RetryPolicy)
        if retry_budget is not None:
            check_budget(retry_budget)
        check_classify(classify, action_type)
        checked = check_observers(observers)
        if on_close not in ("cancel", "abandon"):
            raise ValueError(f"on_close={on_close!r} must be 'cancel' or 'abandon'")
        written = ledger_of(ledger)
        connection, session = transport()
        self._timeouts = timeouts
        self._with_deadline = replace(timeouts, result=None)
        self._retry = retry
        self._classify = classify
        self._budget = RetryBudget() if retry_budget is None else retry_budget
        self._session: Session = session.Session(
            connection.Connection(action_type, action_name, node),
            on_close,
            timeouts.cancel,
            checked,
            written,
        )
        self._action_type: Any = action_type  # pyright knows no properties of a class object
        self._pool = self._session.callbacks
        self._function_pool = function_pool(self.action_name)
        # A client that is dropped without close() must not keep a thread, or goals, alive.
        self._finalizer = weakref.finalize(self, self._session.release)
        self._finalizer.atexit = False  # the session sees to the interpreter's exit itself

    def __repr__(self) -> str:
        state = " closed" if self._session.closed else ""
        return f"<Client {self.action_name!r} ({self._session.identity.type_name}){state}>"

    def __copy__(self) -> Never:
        raise TypeError("a Client cannot be copied: use the same one everywhere, in threads too")

    def __deepcopy__(self, _: dict[int, Any]) -> Never:
        self.__copy__()

    def __reduce__(self) -> Never:
        raise TypeError(
            "a Client cannot be pickled: make one in the process that uses it; results, outcomes"
            " and errors can be pickled"
        )

    @property
    def action_name(self) -> str:
        """The fully qualified name of the action."""
        return str(self._session.identity.action_name)

    @property
    def closed(self) -> bool:
        """Whether the client takes no more calls: it was closed, or ROS was shut down."""
        return self._session.closed

    @property
    def timeouts(self) -> Timeouts:
        """The limits for the phases of each call."""
        return self._timeouts

    @property
    def retry_budget(self) -> RetryBudget:
        """The limit on retries."""
        return self._budget

    @property
    def pending(self) -> int:
        """How many calls of this client are in flight."""
        return len(self._session.calls)

    # --- the two calls ---------------------------------------------------------------------

    def call(
        self: Client[ActionType[GoalT, ResultT, FeedbackT]],
        goal: GoalT | Mapping[str, Any],
        timeout: float | Unset | None = UNSET,
        *,
        on_feedback: Callable[[FeedbackT], object] | None = None,
        retry: RetryPolicy | None = None,
        classify: Classify | None = None,
        replaces: GoalFuture[Any, Any] | None = None,
        preempt: bool = False,
        key: str | None = None,
    ) -> ResultT:
        """Send a goal and wait for its result.

        Ctrl-C cancels the goal on the server, waits for the confirmation, `timeouts.cancel` seconds
        at most, and raises `KeyboardInterrupt`. A second Ctrl-C ends the wait. If the goal may run
        on, the error's last argument and a warning in the log name it.

        Args:
            goal: The action's goal message, or a mapping of its field names.
            timeout: Seconds for everything: the wait for a server, acceptance, execution, retries.
                Then the goal is cancelled, and the server has `timeouts.cancel` seconds to confirm
                that. So with the defaults, `timeout=1.0` takes 3 s if the server is silent. `None`
                means no limit. By default `timeouts.total` counts. With 0 nothing is sent.
            on_feedback: Called with each feedback message that comes before the result, in order,
                on another thread. If it is slow, messages that it has not got 0.05 s after the
                result are left out. The log tells how many, at level INFO.
            retry: Used instead of the client's policy.
            classify: Used instead of the client's.
            replaces: The future of an earlier call of this client. Its goal is cancelled. This goal
                is sent when the earlier one is known to have stopped. If it may still be running
                after `timeouts.cancel` seconds, nothing is sent.
            preempt: With `replaces`: this goal is sent at once, because the server itself stops the
                earlier one when this one comes (as Nav2 does). The earlier call ends as `REPLACED`,
                with a `CancelledError`, when its goal has stopped, or with its result if the goal
                succeeds first. It is not tried again.
            key: A name of this goal in the client's ledger, such as `"leg-3"`. The goal is done
                once, also if the program is killed and started again. If an earlier call with the
                key, of this or an earlier process, has succeeded, this returns its result, and
                sends nothing. If the goal of that call runs, this follows it, and giving up
                cancels it. If it has failed, it is sent again. If no server knows it, it may have
                finished: that is a `GoalUnknownError`.

        Returns:
            The action's result message.

        Raises:
            ActionKitError: The call failed; each subclass is one way to fail. `LedgerError`: the
                goal could not be written down, and was not sent; or another call with its `key`
                is in flight.
            concurrent.futures.CancelledError: `cancel_all()`, `cancel_everything()` or
                `cancel_on_signals()` cancelled the call.
            RuntimeError: Called from one of ActionKit's own callbacks, or after a fork.
            TypeError, ValueError: An argument is wrong, or `key` was used for another goal.
        """
        refuse_in_callback()
        warn_on_event_loop("Client.call()", "await client.call_async()")
        arguments = goal, on_feedback, timeout, retry, classify
        call = self._prepare(*arguments, replaces=replaces, preempt=preempt, key=key)
        future: GoalFuture[ResultT, FeedbackT] = call.future
        try:
            self._session.begin(call)
            return future.result()
        except BaseException as error:
            if not future.done():
                end_interrupted(self._session, call, error)
            raise

    def call_async(
        self: Client[ActionType[GoalT, ResultT, FeedbackT]],
        goal: GoalT | Mapping[str, Any],
        on_feedback: Callable[[FeedbackT], object] | None = None,
        timeout: float | Unset | None = UNSET,
        *,
        retry: RetryPolicy | None = None,
        classify: Classify | None = None,
        replaces: GoalFuture[Any, Any] | None = None,
        preempt: bool = False,
        key: str | None = None,
    ) -> GoalFuture[ResultT, FeedbackT]:
        """Send a goal and return at once. Does not wait for a server.

        The goal is copied: you may change it and use it again afterwards.

        Args:
            goal: The action's goal message, or a mapping of its field names. If it does not fit,
                the future fails with an `InvalidGoalError`. `check_goal` raises that at once.
            on_feedback: As for `call`; a coroutine function runs on the event loop of the caller.
            timeout: As for `call`.
            retry: Used instead of the client's policy.
            classify: Used instead of the client's.
            replaces: As for `call`.
            preempt: As for `call`.
            key: As for `call`.

        Returns:
            A `concurrent.futures.Future` that can also be awaited.

        Raises:
            ClientClosedError: The client was closed.
            LedgerError: The goal could not be written down, and was not sent; or another call with
                its `key` is in flight.
            RuntimeError: This process was forked from the client's.
            TypeError, ValueError: An argument other than `goal` is wrong, or `key` was used for
                another goal.
        """
        arguments = goal, on_feedback, timeout, retry, classify
        call = self._prepare(*arguments, replaces=replaces, preempt=preempt, key=key)
        self._session.begin(call)
        return call.future

    def attach(
        self: Client[ActionType[GoalT, ResultT, FeedbackT]],
        goal_id: uuid.UUID | str,
        *,
        timeout: float | Unset | None = UNSET,
        on_feedback: Callable[[FeedbackT], object] | None = None,
        on_give_up: Literal["leave", "cancel"] = "leave",
    ) -> GoalFuture[ResultT, FeedbackT]:
        """Follow a goal that another client, process or computer has sent, or an earlier run.

        It may also be a goal of this client, if its call is over and the goal may still run. Then
        this call takes it over, and the earlier call asks no more to cancel it.

        Returns at once, and sends no goal. The future is like that of `call_async`: feedback,
        state, result, timeline, `cancel()`. The timeline begins with what the server says now. A
        server of micro-ROS sends a result only to the client that asked last: if you attach to its
        goal, the goal's sender gets none.

        Args:
            goal_id: The goal's id, as in `future.goal_id`, errors, logs and `actionkit watch`.
            timeout: As for `call`.
            on_feedback: As for `call_async`.
            on_give_up: What happens to the goal when you stop following it before it ends: at the
                deadline, when the awaiting task is cancelled, when the client closes or the program
                ends. `"leave"` lets it run. `"cancel"` cancels it, as if this client had sent it.
                `future.cancel()` and `cancel_all()` cancel it in any case.

        Returns:
            A future. It fails with `GoalUnknownError` if no server knows the goal.

        Raises:
            ClientClosedError: The client was closed.
            RuntimeError: This process was forked from the client's.
            TypeError, ValueError: An argument is wrong, or a call of this client that is not over
                has the goal.
        """
        if on_give_up not in ("leave", "cancel"):
            raise ValueError(f"on_give_up={on_give_up!r} must be 'leave' or 'cancel'")
        followed = goal_id_of(goal_id)
        self._session.check_not_followed(followed)
        call = self._prepare(
            None,
            on_feedback,
            timeout,
            RetryPolicy.none(),
            None,
            attach=followed,
            left_alone=on_give_up == "leave",
        )
        self._session.begin(call)
        return call.future

    def check_goal(
        self: Client[ActionType[GoalT, ResultT, FeedbackT]], goal: GoalT | Mapping[str, Any]
    ) -> GoalT:
        """Check a goal without sending it. Needs no server, and never blocks.

        Args:
            goal: As for `call`.

        Returns:
            The goal message that `call` would send; a copy.

        Raises:
            InvalidGoalError: The goal does not fit the action type; `error.field` names the field.
        """
        try:
            message: GoalT = from_plain(self._action_type.Goal, goal)
        except (FieldError, FieldTypeError) as error:
            raise invalid_goal(self.action_name, error) from error
        return message

    def _prepare(
        self,
        goal: object,
        on_feedback: Callable[[Any], object] | None,
        timeout: float | Unset | None,
        retry: RetryPolicy | None,
        classify: Classify | None,
        before_resend: Callable[[], object] | None = None,
        *,
        replaces: GoalFuture[Any, Any] | None = None,
        preempt: bool = False,
        attach: uuid.UUID | None = None,
        left_alone: bool = False,
        key: str | None = None,
    ) -> Call:
        self._session.check()
        unset = isinstance(timeout, Unset)
        seconds = self._timeouts.total if unset else check_seconds("timeout", timeout)
        if retry is not None:
            check_type("retry", retry, RetryPolicy)
        check_classify(classify, self._action_type)
        check_replaces(replaces, preempt, self._session)
        if key is not None:
            from actionkit._calls.sending.keyed import check_key

            check_key(key, self._session, retry or self._retry, replaces)
        callbacks = callbacks_for(on_feedback, self.action_name, self._pool)
        message = invalid = None
        try:
            message = None if attach else from_plain(self._action_type.Goal, goal)
        except (FieldError, FieldTypeError) as error:
            invalid = error
        return self._session.prepare(
            Request(
                goal=message,
                invalid=invalid,
                timeout=seconds,
                timeouts=self._timeouts if seconds is None else self._with_deadline,
                retry=retry or self._retry,
                budget=self._budget,
                classify=self._classify if classify is None else classify,
                callbacks=callbacks,
                pool=self._pool,
                function_pool=self._function_pool,
                replaces=replaces,
                preempt=preempt,
                attach=attach,
                key=key,
                left_alone=left_alone,
                before_resend=before_resend,
            )
        )

    # --- the servers -----------------------------------------------------------------------

    def wait_for_server(self, timeout: float | None = None) -> bool:
        """Block until a server is ready for goals. Calls do this by themselves.

        Args:
            timeout: Seconds, or `None` for no limit.

        Returns:
            Whether one is ready.

        Raises:
            ClientClosedError: The client was closed.
            TypeError, ValueError: A bad `timeout`.
        """
        seconds = check_seconds("timeout", timeout)
        warn_on_event_loop("Client.wait_for_server()", "await client.wait_for_server_async()")
        return self._session.wait_for_server(seconds)

    async def wait_for_server_async(self, timeout: float | None = None) -> bool:
        """Wait until a server is ready for goals, without blocking what runs this coroutine.

        That may be asyncio, trio, or an executor of rclpy.

        Args:
            timeout: As for `wait_for_server`.

        Returns:
            Whether one is ready.

        Raises:
            ClientClosedError: The client was closed.
            RuntimeError: The coroutine does not run under asyncio, trio or rclpy.
            TypeError, ValueError: A bad `timeout`.
        """
        return await self._session.wait_for_server_async(check_seconds("timeout", timeout))

    def server_is_ready(self) -> bool:
        """Whether a server is ready for goals now.

        Raises:
            ClientClosedError: The client was closed.
        """
        return self._session.sees_server()

    # --- the end ---------------------------------------------------------------------------

    def cancel_all(self) -> int:
        """Cancel all calls of this client in flight; never blocks.

        The requests are sent a few at a time. Each call ends when its goal has ended, or when the
        server has confirmed no cancel for `timeouts.cancel` seconds. A call stays in flight if the
        server refuses to cancel its goal.

        Returns:
            How many there were.

        Raises:
            ClientClosedError: The client was closed.
        """
        return self._session.cancel_all()

    def cancel_everything(self, timeout: float = 10.0) -> dict[uuid.UUID, CancelReport]:
        """Cancel all goals of the action, also those of other programs, and wait for that.

        Args:
            timeout: Seconds that the goals have to stop; `timeouts.cancel` does not count here. To
                find them takes 1 to 4 s, even if the timeout is less.

        Returns:
            What happened to each goal. If a server refuses, it is `REFUSED`. If a server in sight
            does not answer in time, or cannot cancel all goals, as those of micro-ROS, its goals
            are `UNKNOWN`: their id is `uuid.UUID(int=0)`.

        Raises:
            ClientClosedError: The client was closed.
            ServerUnavailableError: No server was ready in time; only this client's own calls were
                cancelled.
            RuntimeError: Called from one of ActionKit's own callbacks, or after a fork.
            TypeError, ValueError: A bad `timeout`.
        """
        seconds = check_seconds("timeout", timeout, optional=False)
        assert seconds is not None
        refuse_in_callback()
        name = "Client.cancel_everything()"
        warn_on_event_loop(name, "await asyncio.to_thread(client.cancel_everything)")
        return cancel_everything(self._session, seconds)

    def close(self) -> None:
        """End every goal in flight as `on_close` says, and free everything.

        It waits for the server's confirmations until none has come for `timeouts.cancel` seconds
        and a second more. Many goals are cancelled a few at a time, so with many goals it may wait
        60 s longer. With `on_close="cancel"`, it asks once more to cancel goals that may run though
        their calls are over. A warning names goals that may still be running then. The server is
        asked to cancel them for a little longer.

        It also waits for callbacks that are due or running, 5 s, or `timeouts.cancel` if that is
        longer. A warning names those that have not returned by then. Afterwards none begins. Ctrl-C
        ends each wait.
        """
        self._finalizer.detach()
        close(self._session)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, exc_type: type[BaseException] | None, exc: object, traceback: TracebackType | None
    ) -> None:
        self.close()

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self,
        exc_type: type[BaseException] | None,
        exc: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Close the client without blocking what runs this coroutine."""
        try:
            await in_thread(self.close)
        except BaseException:  # above all where Ctrl-C has cancelled the task
            self._session.callbacks.dues.hurry()
            raise

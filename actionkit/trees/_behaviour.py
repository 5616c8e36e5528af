"""The leaf of a behaviour tree that executes an action."""

from __future__ import annotations

import time
import weakref
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any, Generic, Literal

from py_trees.behaviour import Behaviour
from py_trees.common import Access, Status
from typing_extensions import Self

from actionkit import Client, GoalFuture
from actionkit._internal_api import Classify, check_classify, close_together
from actionkit._model.action_type import ActionType, FeedbackT, GoalT, ResultT
from actionkit._model.arguments import check_type
from actionkit._model.errors import ActionKitError, ClientClosedError, InvalidGoalError, LedgerError
from actionkit._model.printable import on_one_line
from actionkit._model.settings import RetryPolicy, check_seconds
from actionkit.trees import _words
from actionkit.trees._clients import ClientHold
from actionkit.trees._runs import Run, Runs
from actionkit.trees._sources import FromBlackboard, GoalSource, NoGoalError, check_key


class ActionBehaviour(Behaviour, Generic[GoalT, ResultT, FeedbackT]):
    """A leaf that sends a goal, and is RUNNING until the end of the goal is known.

        ActionBehaviour("dock", (Dock, "dock"), {"speed": 0.2}, timeout=30.0)

    It is SUCCESS if the call succeeded, retries included, and FAILURE otherwise. `feedback_message`
    has the progress of the goal, or the error's text. If the tree interrupts the leaf
    (`stop(INVALID)`), the goal is cancelled, even before it is accepted. A tree that is shut down
    or dropped cancels its goals, too. A tick never blocks: it sends, cancels and checks.

    A new run sends its goal only when the earlier goal is known to have stopped. Until then the
    leaf is RUNNING and says so. If the server is silent, the leaf waits at most `timeouts.server`
    of the client. Then it is FAILURE and says that the goal may still run. If the server is gone,
    the leaf does not wait for that goal. For servers that preempt, see `earlier_goal`.
    """

    def __init__(
        self,
        name: str,
        client: Client[ActionType[GoalT, ResultT, FeedbackT]]
        | tuple[type[ActionType[GoalT, ResultT, FeedbackT]], str],
        goal: GoalT | Mapping[str, Any] | Callable[[Self], Any] | FromBlackboard,
        *,
        timeout: float | None = None,
        retry: RetryPolicy | None = None,
        classify: Classify | None = None,
        feedback_key: str | None = None,
        result_key: str | None = None,
        earlier_goal: Literal["wait", "fail", "preempt"] = "wait",
        key: str | Callable[[], str] | None = None,
        server_timeout: float | None = 5.0,
    ) -> None:
        """Make a leaf. Sends nothing, and makes no client yet.

        Args:
            name: The behaviour's name in the tree.
            client: Your own client, which you close; or the action's type and name. Then `setup()`
                makes the client, and it is closed with the tree. Leaves of one process with the
                same action share it.
            goal: A goal message or a mapping of its fields, which is copied; or
                `FromBlackboard("key")`; or a function. The function gets this behaviour. It is
                called in the tick each time a goal is sent.
            timeout: Seconds for each run, as for `Client.call`. They include the wait for an
                earlier goal. `None` means the client's `timeouts.total`.
            retry: Replaces the client's policy.
            classify: Replaces the client's function.
            feedback_key: The blackboard variable for the latest feedback message, written when the
                leaf is ticked. It is unset at the beginning of each run.
            result_key: The same for the result message, also of failed goals if they have one.
            earlier_goal: What a new run does while the goal of an earlier run may still run:
                `"wait"` for its end, or `"fail"` at once and say so. `"preempt"` is for servers
                that stop a goal when a new one comes, as Nav2's and joint_trajectory_controller:
                the earlier goal is cancelled, and the new one is sent at once, as by
                `preempt=True` of `Client.call`. Never use it with a server that runs goals side by
                side, or one after the other. If the server is silent, it is the same as `"wait"`.
            key: As for `Client.call`, with a client that has a ledger. A function is called in the
                tick each time a goal is sent: if the leaf sends several goals, as under a `Repeat`,
                each needs a key of its own.
            server_timeout: Seconds that `setup()` waits for the server of a client that it makes;
                `None` means no limit.

        Raises:
            TypeError, ValueError: An argument is wrong, or the goal does not fit the action.
            AttributeError: Another behaviour is the only permitted writer of a key.
        """
        super().__init__(name)
        self._hold = ClientHold(client)
        self._timeout = check_seconds("timeout", timeout)
        self._server_timeout = check_seconds("server_timeout", server_timeout)
        if retry is not None:
            check_type("retry", retry, RetryPolicy)
        check_classify(classify, self._hold.action_type)
        if earlier_goal not in ("wait", "fail", "preempt"):
            raise ValueError(f"earlier_goal={earlier_goal!r} must be 'wait', 'fail' or 'preempt'")
        self._retry, self._classify, self._earlier_goal = retry, classify, earlier_goal
        if key is not None and not (isinstance(key, str) or callable(key)):
            raise TypeError(f"key={key!r} must be a str, or a function that returns one")
        if key is not None and earlier_goal == "preempt":
            raise ValueError("key= does not go with earlier_goal='preempt': it is sent once")
        self._key = key
        self._board = self.attach_blackboard_client()
        self._source = GoalSource(goal, self._hold.action_type.Goal, self._board)
        self._feedback_key, self._result_key = feedback_key, result_key
        for argument, key in (("feedback_key", feedback_key), ("result_key", result_key)):
            if key is not None:
                check_key(argument, key)
                self._board.register_key(key=key, access=Access.WRITE)
        if feedback_key is not None and feedback_key == result_key:
            raise ValueError(f"feedback_key and result_key must differ; both are {result_key!r}")
        self._runs = Runs()
        self._run: Run | None = None
        self._shown: tuple[Any, Any] = (None, None)
        # A dropped tree leaves no goal running (C11.2). At the interpreter's exit, the clients
        # cancel their goals themselves.
        weakref.finalize(self, self._runs.close).atexit = False

    # --- what users look at ------------------------------------------------------------------

    @property
    def client(self) -> Client[ActionType[GoalT, ResultT, FeedbackT]] | None:
        """The client; `None` if `setup()` has to make it, but was not called yet."""
        return self._hold.client

    @property
    def future(self) -> GoalFuture[ResultT, FeedbackT] | None:
        """The future of the latest run's goal; `None` if that run has not sent one yet."""
        return None if self._run is None else self._run.future

    # --- what py_trees calls -----------------------------------------------------------------

    def setup(self, **kwargs: Any) -> None:
        """Make the client, if none was given, and wait until a server is ready for goals.

        Args:
            kwargs: The arguments of `tree.setup()`. With `node=`, the client is made with that
                node.

        Raises:
            ServerUnavailableError: No server was ready within `server_timeout`.
            ImportError: rclpy cannot be imported.
            ActionTypeMismatchError: This process already uses the name with another type.
            TypeError, ValueError: A bad action name, or `node`.
        """
        node = kwargs.get("node")
        self._hold.make(node)
        for leaf in self._leaves_of_tree():
            # The leaf's own setup raises these again. No other errors: py_trees' time limit for the
            # setup raises somewhere in this code, and only once.
            with suppress(ImportError, TypeError, ValueError, ActionKitError):
                leaf._hold.make(node)  # all find their servers at the same time
        self._hold.await_server(self._server_timeout, self.name)
        self._runs.closed = False

    def initialise(self) -> None:
        """Begin a run, and give up the goal of an earlier run if there is one."""
        client, timeout = self._hold.client, self._timeout
        if timeout is None and client is not None:
            timeout = client.timeouts.total
        self._run = self._runs.begin(timeout)
        self._shown = (None, None)
        for key in (self._feedback_key, self._result_key):
            if key is not None:
                self._board.unset(key)

    def update(self) -> Status:
        """Send the goal when this is allowed, and check its progress."""
        run = self._run
        if run is None:
            self.initialise()
            return self.update()
        if run.future is None and not run.problem:
            self._try_to_start(run)
        if run.problem:
            self.feedback_message = on_one_line(run.problem)
            return Status.FAILURE
        return Status.RUNNING if run.future is None else self._follow(run.future)

    def terminate(self, new_status: Status) -> None:
        """Cancel the goal if it has not ended, because the tree moves on. Never blocks."""
        if new_status is Status.INVALID and self._runs.in_flight():
            self.feedback_message = "interrupted: the server is asked to cancel the goal"
        self._runs.give_up()

    def shutdown(self) -> None:
        """End the tree's goals: cancel the goals of all its leaves, then wait for all of them.

        The wait ends when no goal has ended for `timeouts.cancel` seconds (the longest of all
        clients) and half a second. Then clients that were made only for this tree are closed. The
        leaves send nothing afterwards, unless `setup()` is called again.
        """
        leaves = [leaf for leaf in self._leaves_of_tree() if not leaf._runs.closed]
        for leaf in leaves:
            leaf._runs.close()
        futures = [future for leaf in leaves for future in leaf._runs.in_flight()]
        close_together(filter(None, [leaf._hold.let_go() for leaf in leaves]), futures)

    def _leaves_of_tree(self) -> list[ActionBehaviour[Any, Any, Any]]:
        root: Behaviour = self
        while root.parent is not None:
            root = root.parent
        leaves = {leaf.id: leaf for leaf in root.iterate() if isinstance(leaf, ActionBehaviour)}
        return list({**leaves, self.id: self}.values())

    # --- a run -------------------------------------------------------------------------------

    def _try_to_start(self, run: Run) -> None:
        """Send the goal, unless an earlier goal may run; or record why that is impossible."""
        client = self._hold.client
        if client is None or self._runs.closed:
            run.problem = (
                "nothing was sent: call setup() of the tree first, which makes the client"
                if not self._runs.closed
                else "nothing was sent, because the tree was shut down; setup() begins anew"
            )
        elif client.closed:
            run.problem = "nothing was sent, because the client is closed"
        else:
            earlier, preempted = self._runs.before(run), []
            if self._earlier_goal == "preempt":
                preempted = [each for each in earlier if each.stops_for_another(client)]
            if kept := [each for each in earlier if each not in preempted]:
                self._wait_for(kept[0], run, client)
                return
            how = self._retry, self._classify, preempted[-1] if preempted else None
            try:
                key = self._key() if callable(self._key) else self._key
                run.start(client, self._source.goal(self), *how, key=key)
            except (NoGoalError, ClientClosedError, LedgerError, ValueError) as error:
                run.problem = str(error)

    def _wait_for(self, oldest: Run, run: Run, client: Client[Any]) -> None:
        """Show at the node which earlier goal may run, or record that it was waited for enough."""
        known, future = oldest.known_to_run, oldest.future
        goal_id = "" if future is None else future.goal_id
        now, limit = time.monotonic(), client.timeouts.server
        if known is not None:
            run.unknown_since = None
        elif run.unknown_since is None:
            run.unknown_since = now
        why = None
        if self._earlier_goal == "fail":
            why = ""
        elif run.deadline is not None and now >= run.deadline:
            why = "; the time for this run is up"
        elif limit is not None and now >= (run.unknown_since or now) + limit:
            why = f"; nothing was heard of it for {limit:g} s: its server is silent, or gone"
        if why is not None:
            run.problem = _words.may_still_run(goal_id, known, why)
            return
        refused = future is not None and any(event.cancel_refused for event in future.timeline)
        self.feedback_message = _words.waiting(goal_id, known, refused)

    def _follow(self, future: GoalFuture[ResultT, FeedbackT]) -> Status:
        done = future.done()  # before reading the feedback: the last one comes before the end
        feedback = future.latest_feedback
        if feedback is not None and feedback is not self._shown[1] and self._feedback_key:
            self._board.set(self._feedback_key, feedback)
        if not done:
            state = future.state
            if self._shown[0] is not state or self._shown[1] is not feedback:
                self.feedback_message = _words.running(state, feedback)
                self._shown = (state, feedback)
            return Status.RUNNING
        outcome = future.outcome(0)
        if outcome.result is not None and self._result_key is not None:
            self._board.set(self._result_key, outcome.result)
        if outcome.ok:
            self.feedback_message = _words.succeeded(outcome.elapsed)
            return Status.SUCCESS
        label = self._source.label if isinstance(outcome.error, InvalidGoalError) else ""
        self.feedback_message = on_one_line(f"{label}{outcome.error}")
        return Status.FAILURE

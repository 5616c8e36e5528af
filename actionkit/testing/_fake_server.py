"""A fake server for any action type, in the process of the test."""

from __future__ import annotations

import atexit
import itertools
import logging
import os
import threading
import uuid
from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Any, Generic, Literal

from typing_extensions import Self

from actionkit._model.action_type import ActionType, FeedbackT, GoalT, ResultT, type_name_of
from actionkit._model.environment.domain import LAST_DOMAIN, environment_domain
from actionkit._model.environment.isolation import check_domain
from actionkit._model.missing import cannot_import
from actionkit._model.settings import check_seconds
from actionkit.servers._events import EventNotSeenError, Journal, ServerEvent
from actionkit.testing._fake_notes import Notes, checked_event
from actionkit.testing._fake_plans import Plan, Script

if TYPE_CHECKING:
    from actionkit._ros.tools.presence import Presence
    from actionkit.servers._serving.harness import Harness

_log = logging.getLogger(__name__)
_numbers = itertools.count(1)
_STOP_TIMEOUT = 3.0
"""Seconds for the user's functions to return; all else ends in milliseconds."""
_IN_VIEW_WITHIN = 5.0
"""Seconds until clients of this process see a new server; normally 0.1 to 0.3."""


class FakeServer(Generic[GoalT, ResultT, FeedbackT]):
    """A real action server of your own type, for tests, in this process.

        with FakeServer(Pick, "pick", feedback=[{"percent": 50.0}], result={"ok": True}) as server:
            mission.run()
            assert server.goals == [Pick.Goal(object_id="mug")]

    It has its own ROS context and threads, and does not need `rclpy.init()`.

    The settings say what happens to goals. A value is the same for every goal. A function gets the
    goal and returns the value. `script` has the settings for each goal in turn. A function runs on
    the goal's own thread. If it raises, the goal is rejected (or aborted, if it was accepted). The
    test gets the exception from `wait_for`, or at the latest from `stop` or the end of the `with`
    statement. (The function `cancel` has a thread for each request; if it raises, that request is
    refused.)

    Every method may be called from any thread. When the server stops, it does not end its running
    goals. Real servers do the same.
    """

    def __init__(
        self,
        action_type: type[ActionType[GoalT, ResultT, FeedbackT]],
        name: str,
        *,
        accept: bool | Callable[[GoalT], bool] = True,
        feedback: Iterable[FeedbackT | Mapping[str, Any]]
        | Callable[[GoalT], Iterable[FeedbackT | Mapping[str, Any]]] = (),
        period: float | Callable[[GoalT], float] = 0.0,
        result: ResultT
        | Mapping[str, Any]
        | Callable[[GoalT], ResultT | Mapping[str, Any] | None]
        | None = None,
        end: Literal["succeeded", "aborted", "canceled", "never"] | Callable[[GoalT], str] = (
            "succeeded"
        ),
        cancel: Literal["accept", "refuse", "ignore"] | Callable[[GoalT], str] = "accept",
        preempts: bool | Callable[[GoalT], bool] = False,
        domain_id: int | None = None,
    ) -> None:
        """Check the settings. The server enters the ROS graph with `start` or `with`.

        Args:
            action_type: The action's class.
            name: The action's name.
            accept: Whether goals are accepted.
            feedback: The feedback of a goal while it executes: messages, or mappings of their
                fields. A generator function may yield them, too. Each is published when it is
                yielded. So the test controls the goal if the generator waits for the test.
            period: Seconds after each feedback.
            result: The result: a message, a mapping of its fields, or `None` for an empty one.
                A function is called just before the goal ends.
            end: How goals end. `"never"`: they execute until they are cancelled. `"canceled"`: as
                if somebody else had cancelled them.
            cancel: The answer to a request to cancel: `"accept"` (the goal ends as CANCELED at
                once), `"refuse"`, or `"ignore"` (it is accepted, but the goal goes on to its
                `end`). A function is called for each request, and the answer waits for it. A goal
                that a client cancelled has an empty result, unless `end` is `"never"` or
                `"canceled"`: then it has `result`, and stays in CANCELING until that function
                returns.
            preempts: Whether an accepted goal replaces the running goals, as in Nav2's servers:
                they end as ABORTED with an empty result, then the new goal executes. Otherwise
                goals run side by side.
            domain_id: The ROS domain, 0 to 232; `None` means the environment's domain.

        Raises:
            TypeError: An argument, or a field of a message, has the wrong type.
            ValueError: An argument, or a field of a message, has a wrong value.
            ImportError: rclpy cannot be imported.
        """
        if isinstance(action_type, str):
            raise TypeError(f"action_type={action_type!r} must be the class itself, not its name")
        type_name_of(action_type)
        if domain_id is not None:
            if isinstance(domain_id, bool) or not isinstance(domain_id, int):
                raise TypeError(f"domain_id={domain_id!r} must be an int, or None")
            if not 0 <= domain_id <= LAST_DOMAIN:
                raise ValueError(f"domain_id={domain_id!r} must be 0 to {LAST_DOMAIN}")
        settings: dict[str, Any] = {
            "accept": accept,
            "feedback": feedback,
            "period": period,
            "result": result,
            "end": end,
            "cancel": cancel,
            "preempts": preempts,
        }
        self._ros = _import_ros_side()
        self.name = self._ros.check_name(name)
        self._action: Any = action_type
        self._domain_id = domain_id
        self._number = next(_numbers)
        self._errors: list[BaseException] = []
        self._errors_lock = threading.Lock()
        self._journal = Journal("the fake server", lambda: bool(self._errors))
        self._script = Script(Plan.checked(self._action, settings))
        self._goals = self._ros.Goals(self._script, self._keep)
        self._life = threading.RLock()
        self._harness: Harness | None = None
        self._presence: Presence | None = None
        self._pid = os.getpid()

    # -- what it does ----------------------------------------------------------------------

    def script(
        self,
        entries: Iterable[Mapping[str, Any] | Callable[[GoalT], Mapping[str, Any] | None]]
        | Callable[[GoalT], Mapping[str, Any] | None],
    ) -> None:
        """Say what happens to the next goals; each entry is for one goal, in order.

            server.script([{"accept": False}, {"end": "aborted", "result": {"code": 7}}, {}])

        An entry has settings by name; all other settings are the server's own. An entry may also be
        a function of the goal that returns such a mapping, or `None` for `{}`. After the last
        entry, goals use the server's own settings. Instead of the list, you may give one function
        for every goal from now on. The rest of an earlier script is dropped.

        Args:
            entries: The script.

        Raises:
            TypeError: The script, or a part of it, has the wrong type; then nothing has changed.
            ValueError: A part of it has a wrong value; then nothing has changed.
        """
        self._script.replace(entries)

    # -- what it saw -----------------------------------------------------------------------

    @property
    def goals(self) -> list[GoalT]:
        """Return the received goals, also rejected ones, as messages, in order."""
        return list(self._goals.received)

    @property
    def events(self) -> list[ServerEvent]:
        """Return all events, in order."""
        return list(self._journal.events)

    def count(self, event: str) -> int:
        """Return how many events with a name have happened; `wait_for` lists the names.

        Raises:
            ValueError: There is no event with that name.
        """
        return self._journal.counts[checked_event(event)]

    def running(self) -> set[str]:
        """Return the ids of goals that were accepted and have not ended."""
        return self._journal.running()

    def wait_for(
        self,
        event: str,
        *,
        goal_id: str | uuid.UUID | None = None,
        count: int = 1,
        timeout: float = 10.0,
    ) -> list[ServerEvent]:
        """Block until an event was seen; earlier events count, too. Never polls.

        It blocks its thread. In a coroutine, write
        `await asyncio.to_thread(server.wait_for, "executing")`, so that the event loop goes on.

        Args:
            event: `"received"`, `"accepted"`, `"rejected"`, `"executing"`, `"feedback"`,
                `"cancel_requested"`, `"cancel_accepted"`, `"cancel_refused"`, `"succeeded"`,
                `"aborted"` or `"canceled"`.
            goal_id: Only events of the goal with this id count, such as `future.goal_id`.
            count: How many such events.
            timeout: Seconds to wait.

        Returns:
            All such events until now, `count` or more. A `"received"` event has in its `details`
            the `number` of the goal in `goals`.

        Raises:
            AssertionError: (also a `TimeoutError`) They were not seen in time, or the server was
                stopped without them; the message has all events.
            TypeError, ValueError: An argument is wrong.
            Exception: An error of one of your functions.
        """
        checked_event(event)
        if isinstance(count, bool) or not isinstance(count, int):
            raise TypeError(f"count={count!r} must be an int")
        check_seconds("timeout", timeout, optional=False)
        self._raise_kept()
        wanted = None if goal_id is None else str(goal_id)
        try:
            return self._journal.wait_for(event, goal_id=wanted, count=count, timeout=timeout)
        except EventNotSeenError:
            self._raise_kept()
            raise

    # -- its life --------------------------------------------------------------------------

    def start(self) -> Self:
        """Enter the ROS graph and answer goals. After `stop`, the server comes back.

        It returns when clients of this process that were made without `node=` see the server. If
        that takes more than five seconds, it logs a warning and returns.

        Returns:
            The server itself.

        Raises:
            RuntimeError: The server runs already, or rclpy refuses. Or a test of this process has
                reserved a ROS domain (`isolated_domain`), and the server has another one.
            ValueError: The domain in the environment is not a ROS domain.
        """
        with self._life:
            if self._harness is not None:
                raise RuntimeError(
                    f"{self!r} was started already. The fixture `fake_server` starts its servers"
                    " itself: write `server = fake_server(...)`, without `with`"
                )
            domain = environment_domain() if self._domain_id is None else self._domain_id
            check_domain(domain)
            harness = self._ros.make_harness(
                self._goals,
                self._action,
                self.name,
                domain,
                self._number,
                Notes(self._journal, self._goals.received, self._keep),
            )
            self._pid = os.getpid()
            self._journal.begin()
            self._harness = harness
            try:
                harness.publish_status()
                harness.start()
                atexit.register(self._leave, at_exit=True)
                self._await_clients(domain)
            except BaseException:  # also after Ctrl-C: the `with` statement has not begun
                self._leave()
                raise
        return self

    def stop(self) -> None:
        """Leave the ROS graph and end all threads, within seconds. Safe to call twice.

        Raises:
            RuntimeError: One of your functions has not returned, so its thread still runs.
            Exception: An error of one of your functions that `wait_for` has not raised.
        """
        self._leave()
        self._raise_kept()

    def __enter__(self) -> Self:
        return self.start()

    def __exit__(self, _type: object, error: BaseException | None, _traceback: object) -> None:
        self._leave()
        if error is None or isinstance(error, Exception):
            # Python shows both: the function's error is often the cause of the test's own error.
            self._raise_kept()

    def __repr__(self) -> str:
        state = "stopped" if self._harness is None else "running"
        return f"<FakeServer {self.name!r} ({type_name_of(self._action)}), {state}>"

    # -- private ---------------------------------------------------------------------------

    def _await_clients(self, domain: int) -> None:
        from actionkit._ros.tools.presence import Presence

        self._presence = Presence()
        name = self.name if self.name.startswith("/") else f"/{self.name}"
        if not self._presence.see(self._action, name, domain, _IN_VIEW_WITHIN):
            _log.warning(
                "the fake server of %r runs, but clients in this process had not found it after"
                " %g s: the machine may be overloaded, or the network settings keep them apart"
                " (`actionkit doctor` looks at both)",
                self.name,
                _IN_VIEW_WITHIN,
            )

    def _leave(self, *, at_exit: bool = False) -> None:
        if os.getpid() != self._pid:
            return  # a forked child: the server belongs to its parent
        with self._life:
            harness, self._harness = self._harness, None
            if harness is None:
                return
            atexit.unregister(self._leave)
            self._journal.end()  # a user's function may wait for an event
            try:
                if self._presence is not None:
                    self._presence.leave(at_exit=at_exit)
            finally:  # also after Ctrl-C
                ended = harness.stop(_STOP_TIMEOUT)
            if not ended:
                self._keep(
                    RuntimeError(
                        f"a function given to the fake server of {self.name!r} had not returned"
                        f" {_STOP_TIMEOUT:g} s after the server was stopped; its thread is left"
                    )
                )
            self._journal.end()  # ends events that came in between, too

    def _keep(self, error: BaseException) -> None:
        """Keep an error until the test can get it."""
        with self._errors_lock:
            self._errors.append(error)
        self._journal.wake()

    def _raise_kept(self) -> None:
        with self._errors_lock:
            errors, self._errors = self._errors, []
        if not errors:
            return
        for other in errors[1:]:
            _log.error("the fake server of %r met another error", self.name, exc_info=other)
        raise errors[0]


def _import_ros_side() -> Any:
    try:
        import rclpy  # noqa: F401
    except ImportError as error:
        raise ImportError(cannot_import("rclpy", error)) from error
    from actionkit.testing import _fake_behaviour

    return _fake_behaviour

# rclpy has annotations here and there only.
# mypy: disable-error-code="no-untyped-call"
"""Runs one behaviour as real rclpy ActionServers, in its own process or for a fake server."""

from __future__ import annotations

import threading
import uuid
import warnings
from collections.abc import Callable, Mapping
from typing import Any

from rclpy.action.server import ActionServer, CancelResponse, GoalResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.context import Context
from rclpy.node import Node

from actionkit._ros.rclpy_private.native import outlive_shutdown, shut_down
from actionkit._ros.workarounds.listener_hang import stop_listening
from actionkit.servers._behaviours.behaviour import Behaviour, Process
from actionkit.servers._life import Life
from actionkit.servers._run import Content, Control, Journal, Run
from actionkit.servers._serving.contents import message_of
from actionkit.servers._serving.executors import ThreadPerGoalExecutor, make_executor, spin

_JOIN_TIMEOUT = 1.0
"""Seconds for the spinning thread to end its round, or for our own service to be matched. Both take
milliseconds, and a server must end within `_child._STOP_TIMEOUT`."""


class JournalledServer(ActionServer):
    """An rclpy ActionServer that records each request, and calls a behaviour in its callbacks."""

    def __init__(self, harness: Harness, node: Node, index: int) -> None:
        self._harness = harness
        self._behaviour = harness.behaviour
        self._index = index
        self._goals: dict[str, Run] = {}
        # The callbacks do not get the client's request; but they run on the thread that takes the
        # request in `execute`.
        self._request = threading.local()
        super().__init__(
            node,
            harness.action,
            harness.action_name,
            execute_callback=self._on_execute,
            goal_callback=self._on_goal,
            handle_accepted_callback=self._on_accepted,
            cancel_callback=self._on_cancel,
            callback_group=ReentrantCallbackGroup(),
            result_timeout=self._behaviour.option["result_timeout"],
        )

    async def execute(self, taken_data: dict[str, Any]) -> None:
        """Serve requests; rclpy calls this after it has taken them."""
        # rclpy warns in C if the client has left or is not discovered yet. With `-W error` that
        # would be an exception in the middle of its work. Each time, because pytest changes the
        # filters for each test.
        warnings.filterwarnings("ignore", r"failed to send response \(timeout\)", RuntimeWarning)
        goal = taken_data.pop("goal", None)
        if goal is not None:
            run = self._make_run(goal[1])
            if self._behaviour.takes_time_to_decide(run):
                self._harness.executor.create_task(self._serve_goal, goal, run)
            else:
                await self._serve_goal(goal, run)
        cancel = taken_data.pop("cancel", None)
        if cancel is not None:
            if self._behaviour.takes_time_to_cancel():
                self._harness.executor.create_task(self._serve_cancel, cancel)
            else:
                await self._serve_cancel(cancel)
        if "result" in taken_data:
            await self._serve_result(taken_data.pop("result"))
        if taken_data:
            await super().execute(taken_data)

    # -- requests --------------------------------------------------------------------------

    def _make_run(self, request: Any) -> Run:
        goal_id = _text(request.goal_id)
        # If a request is sent twice, rclpy itself rejects the second.
        first = self._goals.get(goal_id)
        run = Run(
            request.goal,
            goal_id,
            server=self._index,
            number=first.number if first else self._harness.life.next_number(),
            order=self._behaviour.order_of(request.goal),
            journal=self._harness.journal,
            control=self._harness.control,
            make_message=self._harness.make_message,
        )
        again = {"again": True} if first else {}
        self._behaviour.received(run)
        run.emit("goal_received", order=run.order, **again)
        return run

    async def _serve_goal(self, goal: Any, run: Run) -> None:
        self._request.run = run
        await super().execute({"goal": goal})

    async def _serve_cancel(self, cancel: Any) -> None:
        goal_id = cancel[1].goal_info.goal_id
        self._note("cancel_requested", goal_id, running=_text(goal_id) in self._goals)
        cancelled: list[Run] = []
        self._request.cancelled = cancelled
        await super().execute({"cancel": cancel})
        for run in cancelled:
            # Not in the callback: rclpy enters CANCELING only after it, and earlier the goal cannot
            # become CANCELED. The goal may also have ended in between.
            if run.handle.is_cancel_requested:
                run.cancel()
                self._behaviour.cancelled(run)

    async def _serve_result(self, request: Any) -> None:
        goal_id = request[1].goal_id
        self._note("result_requested", goal_id)
        await super().execute({"result": request})
        run = self._goals.get(_text(goal_id))
        if run is not None:
            run.request_result()
            self._behaviour.result_requested(run)

    def _on_goal(self, _goal: Any) -> GoalResponse:
        run: Run = self._request.run
        self._harness.control.add(run)
        if self._behaviour.decide(run):
            # Before the acceptance is sent, because a cancel may follow at once. If the request
            # came again meanwhile, the first one stays.
            self._goals.setdefault(run.goal_id, run)
            return GoalResponse.ACCEPT
        self._harness.control.discard(run)
        why = {"reason": run.reason} if run.reason else {}
        run.emit("rejected", **why)
        return GoalResponse.REJECT

    def _on_accepted(self, handle: Any) -> None:
        run = self._goals[_text(handle.goal_id)]
        run.handle = handle
        run.emit("accepted", order=run.order)
        self._behaviour.accepted(run)
        self._behaviour.begin(run)

    def _on_cancel(self, handle: Any) -> CancelResponse:
        run = self._goals.get(_text(handle.goal_id))
        if run is None:
            return CancelResponse.REJECT
        # A goal may be cancelled before `_on_accepted` is called.
        run.handle = handle
        if not self._behaviour.may_cancel(run):
            run.emit("cancel_refused")
            return CancelResponse.REJECT
        run.emit("cancel_accepted")
        self._request.cancelled.append(run)
        return CancelResponse.ACCEPT

    def _on_execute(self, handle: Any) -> Any:
        run = self._goals[_text(handle.goal_id)]
        try:
            if run.dropped:
                return run.canceled()
            run.emit("executing")
            return self._behaviour.execute_to_end(run)
        finally:
            self._harness.control.discard(run)
            self._goals.pop(run.goal_id, None)

    def _note(self, event: str, goal_id: Any, **details: Any) -> None:
        if self._index:
            details["server"] = self._index
        self._harness.journal.emit(event, _text(goal_id), **details)


class Harness:
    """A behaviour, its nodes, its action servers and the thread that spins them."""

    def __init__(
        self,
        make_behaviour: Callable[[Mapping[str, Any], Process], Behaviour],
        options: Mapping[str, Any],
        action: Any,
        action_name: str,
        *,
        node_name: str,
        journal: Journal,
        life: Life,
        foreign: bool = False,
        domain_id: int | None = None,
    ) -> None:
        """Make the servers; they answer nothing before `start`.

        Args:
            make_behaviour: The behaviour's class.
            options: All of its options.
            action: The action's class.
            action_name: The name to serve.
            node_name: Of the first node; the names of later nodes end with a number.
            journal: Gets the events.
            life: The process, for the behaviour.
            foreign: Whether the action has another type than the behaviour's own.
            domain_id: The ROS domain; `None` takes the environment's.

        Raises:
            ValueError: The behaviour refuses an option.
            Exception: rclpy refuses the name.
        """
        self.action_name = action_name
        self.journal = journal
        self.control = Control()
        self.life = life
        self.action = action
        self.foreign = foreign
        self._node_name = node_name
        self._context = Context()
        # No log files and no signal handlers: the process has its own.
        self._context.init(args=[], initialize_logging=False, domain_id=domain_id)
        self.executor = make_executor(options["threads"], self._context, self._on_error)
        self._canceller: Any = None
        self._nodes: list[Node] = []
        self._servers: dict[int, JournalledServer] = {}
        try:
            self.behaviour = make_behaviour(options, self)
            for index in range(self.behaviour.servers):
                self._servers[index] = JournalledServer(self, self._add_node(), index)
        except BaseException:  # nothing is left behind
            self._take_down()
            raise
        self._spinner = threading.Thread(
            target=spin,
            args=(self.executor, lambda: self.control.stopping, self._on_error),
            name="spin",
            daemon=True,
        )

    def publish_status(self) -> None:
        """Publish that there are no goals; call it before `start`.

        rclpy's servers publish their first status with their first goal. A client that gets a
        status knows that the server has discovered it. Otherwise the client's first goal waits 0.1
        s.
        """
        for server in self._servers.values():
            server._handle.publish_status()

    def start(self) -> None:
        """Begin to answer."""
        self._spinner.start()

    def stop(self, seconds: float = 0) -> bool:
        """Leave the ROS graph, at once and properly. Running goals are not ended.

        Wait for the goals' threads at most this many seconds; they end at once, unless they run
        foreign code. Return whether they have ended.
        """
        self.control.stop()
        try:
            if self._context.ok():
                # Not executor.wake(): that ends a wait, but spin_once ends only with a task.
                self.executor.create_task(lambda: None)
            # While the spinning thread waits, it keeps its entities alive.
            self._spinner.join(_JOIN_TIMEOUT)
            ended = True
            if isinstance(self.executor, ThreadPerGoalExecutor):
                ended = self.executor.join_goals(seconds)
        finally:  # also after Ctrl-C in one of these waits, because this is not called again
            self._take_down()
        return ended

    def _take_down(self) -> None:
        # The thread may still be in a round that uses the entities.
        self.executor.shutdown(timeout_sec=0)
        for index in list(self._servers):
            self._destroy(index)
        for node in self._nodes[1:]:
            node.destroy_node()
        for node in self._nodes[:1]:
            stop_listening(node)
            node.destroy_node()
        shut_down(self._context)

    # -- for behaviours --------------------------------------------------------------------

    def enable_self_cancel(self) -> None:
        self._canceller = self._add_node().create_client(
            self.action.Impl.CancelGoalService, f"{self.action_name}/_action/cancel_goal"
        )

    def cancel_from_elsewhere(self, goal_id: str) -> None:
        if self._canceller is None:
            raise RuntimeError("enable_self_cancel() was not called")
        request = self._canceller.srv_type.Request()
        request.goal_info.goal_id.uuid = list(uuid.UUID(goal_id).bytes)
        self._canceller.wait_for_service(timeout_sec=_JOIN_TIMEOUT)
        self._canceller.call_async(request)

    def destroy_server(self, index: int) -> None:
        # On the spinning thread, between two waits: on another thread, it would remove the server
        # from the wait set during a wait.
        self.executor.create_task(self._destroy, index)

    def make_message(self, part: str, content: Content) -> Any:
        """Return a message of the action: its "Feedback" or its "Result"."""
        message = getattr(self.action, part)()
        if self.foreign and not isinstance(content, type(message)):
            return message  # the behaviour's contents are for fields of its own type
        return message_of(message, content)

    # -- private ---------------------------------------------------------------------------

    def _add_node(self) -> Node:
        number = f"_{len(self._nodes)}" if self._nodes else ""
        node = Node(
            f"{self._node_name}{number}",
            context=self._context,
            enable_rosout=False,
            start_parameter_services=False,
        )
        outlive_shutdown(node)
        self._nodes.append(node)
        self.executor.add_node(node)
        return node

    def _destroy(self, index: int) -> None:
        server = self._servers.pop(index, None)  # destroying one twice raises
        if server is not None:
            server.destroy()

    def _on_error(self, error: BaseException) -> None:
        if not self.control.stopping:
            self.journal.emit("error", message=repr(error))


def _text(goal_id: Any) -> str:
    return str(uuid.UUID(bytes=bytes(goal_id.uuid)))

"""Shared by tests of the reference servers: a plain rclpy client, and checks of journals."""

from __future__ import annotations

import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any

from action_msgs.msg import GoalStatus
from rclpy.action import ActionClient
from rclpy.action.client import ClientGoalHandle
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from test_msgs.action import Fibonacci
from unique_identifier_msgs.msg import UUID

from actionkit import servers
from actionkit._ros.workarounds.listener_hang import stop_listening

SUCCEEDED = GoalStatus.STATUS_SUCCEEDED
CANCELED = GoalStatus.STATUS_CANCELED
ABORTED = GoalStatus.STATUS_ABORTED
UNKNOWN = GoalStatus.STATUS_UNKNOWN
OK, UNKNOWN_GOAL = 0, 2  # answers to a cancel request

PATIENCE = 90.0  # seconds; long, for loaded machines: nothing here waits for it to run out

RAN = ["goal_received", "accepted", "executing"]


class Driver:
    """An rclpy action client with a context of its own, spun only while it waits."""

    def __init__(self, domain: int, action_type: Any = Fibonacci, name: str = "fibonacci") -> None:
        self.context = Context()
        self.context.init(args=[], initialize_logging=False, domain_id=domain)
        self.node = Node(
            "driver", context=self.context, enable_rosout=False, start_parameter_services=False
        )
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.type = action_type
        self.name = name
        self.client = ActionClient(self.node, action_type, name)
        self.feedback: dict[str, list[Any]] = {}

    def close(self) -> None:
        # First the executor: half-way through a round it still uses the entities.
        self.executor.shutdown()
        self.client.destroy()
        stop_listening(self.node)
        self.node.destroy_node()
        self.context.shutdown()

    def connect(self) -> Driver:
        assert self.client.wait_for_server(PATIENCE)
        # Ready is not yet connected: an answer may be lost until the server knows our reader.
        # Endpoints become known in the order of their creation and the result service is the
        # last, so once it has answered, all three do.
        while True:
            answer = self.result_of(uuid.uuid4())
            self.executor.spin_until_future_complete(answer, 1.0)
            if answer.done():
                return self
            answer.cancel()

    def wait(self, future: Any) -> Any:
        self.executor.spin_until_future_complete(future, PATIENCE)
        assert future.done(), "no answer"
        return future.result()

    def send(
        self, order: int = 5, goal_id: uuid.UUID | None = None, goal: Any = None
    ) -> tuple[str, Any]:
        """Returns the goal's id and the future of its handle."""
        goal_id = goal_id or uuid.uuid4()
        if goal is None:
            goal = self.type.Goal(order=order) if self.type is Fibonacci else self.type.Goal()
        future = self.client.send_goal_async(
            goal,
            feedback_callback=partial(self._note, self.feedback.setdefault(str(goal_id), [])),
            goal_uuid=_message(goal_id),
        )
        return str(goal_id), future

    def accepted(self, order: int = 5, goal: Any = None) -> tuple[str, ClientGoalHandle]:
        goal_id, future = self.send(order, goal=goal)
        handle = self.wait(future)
        assert handle.accepted
        return goal_id, handle

    def rejected(self, order: int = 5, goal: Any = None) -> str:
        goal_id, future = self.send(order, goal=goal)
        assert not self.wait(future).accepted
        return goal_id

    def result_of(self, goal_id: uuid.UUID) -> Any:
        return ClientGoalHandle(self.client, _message(goal_id), None).get_result_async()

    def servers(self) -> list[str]:
        """Return the nodes that serve the action: also one of another test, if domains clash."""
        topic = self.node.resolve_topic_name(f"{self.name}/_action/status")
        return [info.node_name for info in self.node.get_publishers_info_by_topic(topic)]

    def cancel(self, goal_id: str) -> tuple[int, list[str]]:
        handle = ClientGoalHandle(self.client, _message(uuid.UUID(goal_id)), None)
        answer = self.wait(handle.cancel_goal_async())
        ids = [str(uuid.UUID(bytes=bytes(i.goal_id.uuid))) for i in answer.goals_canceling]
        return answer.return_code, ids

    def call(self, order: int = 5) -> tuple[str, int, list[int]]:
        """Returns the goal's id, status and sequence."""
        goal_id, handle = self.accepted(order)
        return (goal_id, *self.outcome(handle))

    def outcome(self, handle: ClientGoalHandle) -> tuple[int, list[int]]:
        answer = self.wait(handle.get_result_async())
        return answer.status, list(answer.result.sequence)

    @staticmethod
    def _note(log: list[Any], message: Any) -> None:
        feedback = message.feedback
        log.append(list(feedback.sequence) if hasattr(feedback, "sequence") else feedback)


def _message(goal_id: uuid.UUID) -> UUID:
    return UUID(uuid=list(goal_id.bytes))


@contextmanager
def checked(start: Callable[..., servers.Server]) -> Iterator[Callable[..., servers.Server]]:
    """As the fixture `action_server`, and it checks that every server leaves in good order."""
    started: list[servers.Server] = []

    def start_one(*arguments: Any, **options: Any) -> servers.Server:
        started.append(start(*arguments, **options))
        return started[-1]

    yield start_one
    for server in started:
        if server.alive:
            assert server.terminate() == 0
        on_purpose = any(event.details.get("raised") for event in server.events)
        assert on_purpose or "Traceback" not in server.stderr


def story(server: servers.Server, goal_id: str) -> list[str]:
    """What happened to a goal on its server, without requests for its result."""
    return [
        event.event
        for event in server.events
        if event.goal_id == goal_id and event.event != "result_requested"
    ]

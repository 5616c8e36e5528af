"""What a link sends for its goals and reports to them, with servers that the test simulates."""

from __future__ import annotations

import uuid
from collections import deque
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import pytest
from action_msgs.srv import CancelGoal
from rclpy.qos import QoSProfile
from test_msgs.action import Fibonacci

from actionkit._ros.communication.outbox import WINDOW
from actionkit._ros.endpoints.names import ActionNames
from actionkit._ros.sending import link
from actionkit._ros.sending.link import Link
from tests.unit.clock import CommunicationThread
from tests.unit.test_wire import status_array

TYPE = "test_msgs/action/Fibonacci"
UNKNOWN = CancelGoal.Response.ERROR_UNKNOWN_GOAL_ID
A, B = b"a" * 16, b"b" * 16


class Service:
    """A service client: what was sent by it, and the answers that wait to be read."""

    def __init__(self, on_response: Callable[[int, Any], None]) -> None:
        self._on_response = on_response
        self.sent: list[Any] = []
        self.answers: deque[tuple[int, Any]] = deque()

    def send(self, request: Any) -> int:
        self.sent.append(request)
        return len(self.sent)

    def take(self) -> None:
        while self.answers:
            self._on_response(*self.answers.popleft())

    def answer(self, response: Any, seq: int | None = None) -> None:
        """Let an answer come, and the thread read it; to the last request, where none is named."""
        self.answers.append((len(self.sent) if seq is None else seq, response))
        self.take()


class Topic:
    """The feedback subscription."""

    def __init__(self) -> None:
        self.queue: list[bytes] = []

    def take(self) -> list[bytes]:
        taken, self.queue = self.queue, []
        return taken

    def discard(self) -> None:
        self.queue = []


class Entities:
    """The entities of a link, without any middleware."""

    def __init__(self, node: Any, impl: Any, name: str, **callbacks: Any) -> None:
        self.goal = Service(callbacks["on_goal"])
        self.result = Service(callbacks["on_result"])
        self.cancel = Service(callbacks["on_cancel"])
        self.feedback = Topic()
        self.matched = self
        self.event: tuple[int, int] | None = None
        self.status: Topic | None = None
        self.sources = [self.goal, self.result, self.cancel, self.feedback, self.matched]
        self.on_matched = callbacks["on_matched"]
        self.destroyed = False

    def services_ready(self) -> bool:
        return True

    def subscribe_status(self, on_status: Callable[[], None]) -> Topic:
        self.status = Topic()
        self.status.on_readable = on_status  # type: ignore[attr-defined]
        return self.status

    def unsubscribe_status(self, source: Topic) -> None:
        assert source is self.status
        self.status = None

    def take(self) -> None:
        event, self.event = self.event, None
        if event is not None:
            self.on_matched(*event)

    def destroy(self) -> None:
        self.destroyed = True


class Listener:
    """Notes what it is told; sends its goal when it has its turn."""

    def __init__(self, link: Any) -> None:
        self.goal_id = uuid.uuid4()
        self.unwanted = False
        self.told: list[str] = []
        self._link = link

    def on_turn(self) -> None:
        if self.unwanted:
            self._link.dequeue(self, self.goal_id)
            return
        try:
            self._link.send_goal(self, Fibonacci.Goal(order=1))
        except AttributeError:
            self.told.append("send_failed")
            self._link.dequeue(self, self.goal_id)
        else:
            self.told.append("sent")

    def __getattr__(self, name: str) -> Callable[..., None]:
        if not name.startswith("on_"):
            raise AttributeError(name)
        return lambda *args, **kwargs: self.told.append(name.removeprefix("on_"))

    def news(self) -> list[str]:
        told, self.told[:] = list(self.told), []
        return told


class World(CommunicationThread):
    """A link on a thread with a clock that the test moves."""

    def __init__(self) -> None:
        super().__init__()
        self.kept_until = 0.0
        self.gids: list[bytes] = []
        self.node = SimpleNamespace(
            get_publishers_info_by_topic=self._publishers,
            get_subscriptions_info_by_topic=lambda *_, **__: [],
            get_name=lambda: "ours",
        )
        self.windows: dict[type, Any] = {}
        self.node_replacement = SimpleNamespace(links={})
        self.watched = 0
        self.standstill = SimpleNamespace(watch=self._watch)
        self.link: Any = Link(  # type: ignore[arg-type]
            self, Fibonacci, TYPE, ActionNames.of("/fibonacci")
        )
        self.entities: Any = self.link._entities

    def _watch(self) -> None:
        self.watched += 1

    def window(self, kind: type, action_name: str) -> Any:
        return self.windows.setdefault(kind, kind())

    def keep_until(self, at: float) -> None:
        self.kept_until = at

    def _publishers(self, topic: str, *, no_mangle: bool = False) -> list[Any]:
        if no_mangle and "send_goalReply" not in topic:  # versions of types: none are told here
            return []
        return [
            SimpleNamespace(
                qos_profile=QoSProfile(depth=1),
                endpoint_gid=list(gid),
                topic_type=TYPE + "_FeedbackMessage",
                node_name="server",
                node_namespace="/",
            )
            for gid in self.gids
        ]

    def serve(self, *gids: bytes) -> None:
        """Let these servers be there, and answer the probe where one of them is new."""
        came = len(set(gids) - set(self.gids))
        self.gids = list(gids)
        self.entities.on_matched(len(gids), came)
        if came:
            self.advance(0.1)
            self.entities.cancel.answer(CancelGoal.Response(return_code=UNKNOWN))

    def send(self) -> Listener:
        listener = Listener(self.link)
        self.link.enqueue(listener, listener.goal_id)
        return listener

    def accept(self, seq: int | None = None, *, accepted: bool = True) -> None:
        self.entities.goal.answer(SimpleNamespace(accepted=accepted), seq)

    def result(self, status: int) -> None:
        self.entities.result.answer(SimpleNamespace(status=status, result=Fibonacci.Result()))


@pytest.fixture
def world(monkeypatch: pytest.MonkeyPatch) -> Iterator[World]:
    monkeypatch.setattr(link, "Entities", Entities)
    world = World()
    yield world
    world.link.close()
    assert world.entities.destroyed
    assert world.entities.status is None
    assert world.sources == set()
    sent = len(world.entities.cancel.sent)
    world.advance(100.0)
    assert len(world.queue) == 0
    assert len(world.entities.cancel.sent) == sent


def test_a_goal_s_way_and_what_is_left_of_it(world: World) -> None:
    goal = world.send()
    assert goal.news() == []
    world.serve(A)
    assert goal.news() == ["sent"]
    world.accept()
    world.link.ask_result(goal)
    world.result(4)
    assert goal.news() == ["accepted", "result"]
    world.link.forget(goal)
    assert not any(world.link.table_sizes().values())
    world.accept()
    world.result(4)
    world.serve()
    assert goal.news() == []


def test_a_goal_that_is_accepted_after_its_end_is_told_of_once(world: World) -> None:
    """Another server on the name has it, too (R14)."""
    told = list[tuple[int, str]]()
    world.link.on_accepted_late = lambda request, kept: told.append((request, kept))
    world.serve(A)
    goal = world.send()
    world.accept()
    world.link.forget(goal, "facts")
    world.accept()
    world.accept()
    assert told == [(1, "facts")]
    again = Listener(world.link)
    world.link.follow_goal(again, 1)
    world.accept()  # a third server
    assert again.news() == ["accepted"]
    world.link.forget(again)


def test_a_server_that_has_sent_its_status_is_asked_at_once(world: World) -> None:
    """It went to a subscription that was made after all the others, so it knows those, too."""
    world.gids = [A]
    world.entities.on_matched(1, 1)
    world.advance(0.005)
    assert world.entities.status in world.sources
    assert world.entities.cancel.sent == []
    world.entities.status.on_readable()
    assert len(world.entities.cancel.sent) == 1
    assert world.entities.status is None
    world.advance(0.005)
    world.entities.cancel.answer(CancelGoal.Response(return_code=UNKNOWN))
    assert world.link.server_is_ready()


@pytest.mark.parametrize("then", ["ready", "gone", "closed"])
def test_status_is_waited_for_no_longer_than_it_says_anything(world: World, then: str) -> None:
    world.gids = [A]
    world.entities.on_matched(1, 1)
    assert world.entities.status is not None
    if then == "closed":
        return  # the fixture closes it, and looks
    if then == "gone":
        world.serve()
    else:
        world.advance(0.6)
        assert world.link.server_is_ready()
    assert world.entities.status is None


def test_each_call_has_this_process_watched_for_standstills(world: World) -> None:
    """That ends when nothing is in flight (C5.4)."""
    before = world.watched
    listener = Listener(world.link)
    world.link.await_server(listener)
    assert world.watched == before + 1
    world.link.dequeue(listener, listener.goal_id)


def test_a_goal_that_is_unwanted_meanwhile_is_not_sent(world: World) -> None:
    first, second = world.send(), world.send()
    first.unwanted = True
    world.serve(A)
    assert (first.news(), second.news()) == ([], ["sent"])
    assert len(world.entities.goal.sent) == 1


def test_goals_that_are_unwanted_hold_up_no_other(world: World) -> None:
    unwanted = [world.send() for _ in range(2 * WINDOW)]
    for goal in unwanted:
        goal.unwanted = True
    wanted = world.send()
    world.serve(A)
    assert wanted.news() == ["sent"]


def test_a_goal_that_was_not_sent_or_is_forgotten_is_not_cancelled(world: World) -> None:
    goal = world.send()
    world.link.ask_cancel(goal, urgent=False)
    world.serve(A)
    world.link.forget(goal)
    asked = len(world.entities.cancel.sent)
    world.link.ask_cancel(goal, urgent=False)
    world.advance(10.0)
    assert goal.news() == ["sent"]
    assert len(world.entities.cancel.sent) == asked


def test_a_goal_that_cannot_be_sent_holds_up_no_other(world: World) -> None:
    world.serve(A)
    world.link._requests._impl = SimpleNamespace()  # where rclpy's converters would raise
    broken = [world.send() for _ in range(2 * WINDOW)]
    assert {tuple(listener.news()) for listener in broken} == {("send_failed",)}
    world.link._requests._impl = Fibonacci.Impl
    assert world.send().news() == ["sent"]


def test_no_more_than_a_window_is_sent_unanswered(world: World) -> None:
    world.serve(A)
    goals = [world.send() for _ in range(WINDOW + 2)]
    assert [goal.news() for goal in goals] == WINDOW * [["sent"]] + [[], []]
    world.link.leave_outbox(goals[0])
    world.link.dequeue(goals[-1], goals[-1].goal_id)
    world.link.leave_outbox(goals[1])
    assert [goal.news() for goal in goals[WINDOW:]] == [["sent"], []]


def test_a_goal_that_waits_for_its_turn_is_told_that_the_last_server_went(world: World) -> None:
    world.serve(A)
    goals = [world.send() for _ in range(WINDOW + 1)]
    world.serve()
    told = ["sent", "servers_changed", "server_lost"]
    assert [goal.news() for goal in goals] == WINDOW * [told] + [["server_lost"]]


def test_what_a_server_said_before_it_went_is_read_first(world: World) -> None:
    world.serve(A)
    goal = world.send()
    world.link.ask_result(goal)
    world.entities.goal.answers.append((1, SimpleNamespace(accepted=True)))
    world.entities.result.answers.append((1, SimpleNamespace(status=4, result=Fibonacci.Result())))
    world.entities.feedback.queue.append(bytes(4) + goal.goal_id.bytes)
    world.serve()
    # Accepted, then all feedback, which the result may have overtaken, and only then lost.
    last = ["servers_changed", "server_lost"]
    assert goal.news() == ["sent", "accepted", "feedback", "result", *last]
    world.serve(A)
    other = world.send()
    world.entities.feedback.queue.append(bytes(4) + other.goal_id.bytes)
    world.serve()
    assert other.news() == ["sent", "feedback", *last]


def test_the_status_that_came_before_a_result_is_read_first(world: World) -> None:
    """It may show that somebody else has cancelled the goal (C4.4)."""
    world.serve(A)
    goal = world.send()
    world.link.watch_status()
    world.link.ask_result(goal)
    goal.news()
    world.entities.status.queue.append(status_array([(goal.goal_id.bytes, 3)]))
    world.result(5)
    assert goal.news() == ["status", "result"]
    world.link.forget(goal)


def test_of_two_servers_one_that_does_not_know_a_goal_proves_nothing(world: World) -> None:
    world.serve(A)
    goal = world.send()
    world.accept()
    world.serve(A, B)
    world.link.ask_result(goal)
    world.link.ask_cancel(goal, urgent=True)
    goal.news()
    world.result(0)
    assert world.link.monitor.restarts.running  # is the other one dead?
    world.advance(2.0)
    world.entities.cancel.answer(CancelGoal.Response(return_code=UNKNOWN))
    assert world.link.monitor.restarts.running
    assert "result" not in goal.news()
    assert "cancel_answer" not in goal.news()
    world.serve(A)
    world.result(0)
    world.entities.cancel.answer(CancelGoal.Response(return_code=UNKNOWN))
    assert goal.news() == ["servers_changed", "result", "cancel_answer"]


@pytest.mark.parametrize(("status", "told"), [(0, True), (2, False), (4, True), (9, True)])
def test_a_result_that_tells_of_no_end_is_not_told(world: World, status: int, told: bool) -> None:
    world.serve(A)
    goal = world.send()
    world.link.ask_result(goal)
    goal.news()
    world.result(status)
    assert goal.news() == (["result"] if told else [])


def test_whether_a_server_is_ready_is_asked_of_the_middleware(world: World) -> None:
    assert not world.link.server_is_ready()
    world.entities.feedback.queue.append(bytes(20))  # others' feedback: a pause of a second
    world.link._feedback.look()
    world.gids = [A]
    world.entities.event = (1, 1)
    assert not world.link.server_is_ready()  # it has not answered yet
    world.advance(0.1)
    world.entities.cancel.answer(CancelGoal.Response(return_code=UNKNOWN))
    assert world.link.server_is_ready()


def test_the_answers_to_probes_are_waited_for_only_while_they_matter(world: World) -> None:
    world.serve(A)
    assert world.entities.cancel not in world.sources
    world.serve(A, B)
    world.link.monitor.restarts.start()
    world.advance(0.3)
    world.entities.cancel.answer(CancelGoal.Response(return_code=UNKNOWN))
    assert world.entities.cancel in world.sources  # the second answer matters now
    world.advance(1.0)
    world.entities.cancel.answer(CancelGoal.Response(return_code=UNKNOWN))
    assert world.entities.cancel not in world.sources


@pytest.mark.parametrize("silent", [0.05, 0.2])
def test_the_node_is_kept_where_a_server_may_have_been_killed(world: World, silent: float) -> None:
    world.serve(A)
    world.link.ask_cancel(world.send(), urgent=False)
    since = world.time
    world.advance(silent)
    world.link.close()
    assert world.kept_until == (since + 4.0 if silent > 0.1 else 0.0)


def test_the_node_is_not_kept_where_no_server_is_left_to_answer(world: World) -> None:
    world.serve(A)
    world.link.ask_cancel(world.send(), urgent=False)
    world.advance(1.0)
    world.serve()
    world.link.close()
    assert world.kept_until == 0.0


def test_the_node_is_not_kept_where_a_server_has_answered(world: World) -> None:
    world.serve(A)
    world.link.ask_cancel(world.send(), urgent=False)
    world.advance(0.3)
    world.entities.cancel.answer(CancelGoal.Response())
    world.advance(0.05)
    world.link.close()
    assert world.kept_until == 0.0

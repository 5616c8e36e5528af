"""Recordings with servers that disagree, clocks that differ, and requests for several goals (C6.3).

The messages are serialised by rclpy; what they tell is made up.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from action_msgs.msg import GoalInfo, GoalStatus, GoalStatusArray
from action_msgs.srv import CancelGoal
from builtin_interfaces.msg import Time
from rclpy.serialization import serialize_message
from test_msgs.action import Fibonacci
from unique_identifier_msgs.msg import UUID

import actionkit as ak
from actionkit import GoalState, RecordedGoal
from tests.recordings import bags

S = GoalState
IMPL = Fibonacci.Impl
BEGAN = 1_800_000_000
ACCEPTED, EXECUTING, CANCELING, SUCCEEDED, CANCELED, ABORTED = range(1, 7)
ALL = 0
"""The number of no goal."""
REQUEST_SENT, REQUEST_RECEIVED, RESPONSE_SENT, RESPONSE_RECEIVED = range(4)
SERVICES = {
    "send_goal": (IMPL.SendGoalService, f"{bags.FIBONACCI}_SendGoal_Event"),
    "get_result": (IMPL.GetResultService, f"{bags.FIBONACCI}_GetResult_Event"),
    "cancel_goal": (CancelGoal, "action_msgs/srv/CancelGoal_Event"),
}


def time_of(at: float) -> Time:
    return Time(sec=BEGAN + int(at // 1), nanosec=round(at % 1 * 1e9)) if at else Time()


def goal_id(number: int) -> UUID:
    return UUID(uuid=list(number.to_bytes(16, "big")))


def info(number: int, accepted: float) -> GoalInfo:
    return GoalInfo(goal_id=goal_id(number), stamp=time_of(accepted))


class Story:
    """What a recorder gets. Times are in seconds after a beginning."""

    def __init__(self) -> None:
        self.messages: list[bags.Message] = []

    def _add(self, at: float, topic: str, ros_type: str, data: bytes) -> Story:
        stamp = BEGAN * 10**9 + round(at * 1e9)
        self.messages.append(bags.Message(f"/arm/_action/{topic}", ros_type, stamp, data))
        return self

    def status(self, at: float, *goals: tuple[int, float, int]) -> Story:
        """Add a status: of each goal its number, when it was accepted, and its code."""
        entries = [GoalStatus(goal_info=info(n, when), status=code) for n, when, code in goals]
        data = serialize_message(GoalStatusArray(status_list=entries))
        return self._add(at, "status", "action_msgs/msg/GoalStatusArray", data)

    def event(
        self, at: float, service: str, kind: int, *, of: int = 1, by: int = 1, clock: float = 0.0,
        cut: int | None = None, **fields: Any,
    ) -> Story:  # fmt: skip
        """Add a service event of request number `of` of client `by`."""
        cls, ros_type = SERVICES[service]
        message = cls.Event()
        message.info.event_type = kind
        message.info.stamp = time_of(at + clock)
        message.info.client_gid = [by] * 16
        message.info.sequence_number = of
        part = cls.Request if kind in (REQUEST_SENT, REQUEST_RECEIVED) else cls.Response
        name = "request" if part is cls.Request else "response"
        setattr(message, name, [part(**fields)])
        return self._add(
            at, f"{service}/_service_event", ros_type, serialize_message(message)[:cut]
        )

    def sent(self, at: float, number: int, **more: Any) -> Story:
        """Add the request that sends a goal."""
        fields = {"goal_id": goal_id(number), "goal": Fibonacci.Goal(order=number)}
        return self.event(at, "send_goal", REQUEST_RECEIVED, of=number, **fields, **more)

    def answered(self, at: float, number: int, accepted: bool, **more: Any) -> Story:
        """Add the answer to it."""
        return self.event(at, "send_goal", RESPONSE_SENT, of=number, accepted=accepted, **more)

    def cancel(self, at: float, number: int, before: float = 0.0, **more: Any) -> Story:
        """Add a request to cancel."""
        which = info(number, before)
        return self.event(at, "cancel_goal", REQUEST_RECEIVED, goal_info=which, **more)

    def cancels(self, at: float, *goals: tuple[int, float], code: int = 0, **more: Any) -> Story:
        """Add the answer to it."""
        agreed = [info(*goal) for goal in goals]
        fields = {"return_code": code, "goals_canceling": agreed}
        return self.event(at, "cancel_goal", RESPONSE_SENT, **fields, **more)


@pytest.fixture
def read(tmp_path: Path) -> Callable[[Story], ak.RecordedGoals]:
    return lambda story: ak.read_goals(bags.mcap(tmp_path / "x.mcap", story.messages))


def number_of(goal: RecordedGoal) -> int:
    return goal.goal_id.int


def details(goal: RecordedGoal, word: str = "cancel it") -> list[str]:
    return [event.detail for event in goal.timeline if word in event.detail]


AGREES, REFUSES = "the server agrees to cancel it", "the server refuses to cancel it"
ASKS = f"program {'01' * 12} asks to cancel it"


@pytest.mark.parametrize("clock", [-0.9, -2.0, 0.3])
def test_clocks_that_differ_change_no_state(read, clock: float) -> None:
    story = Story().sent(1.0, 7, clock=clock).answered(1.1, 7, True, clock=clock)
    story.status(1.2, (7, 1.1 + clock, EXECUTING)).event(
        2.0, "get_result", REQUEST_RECEIVED, goal_id=goal_id(7), clock=clock
    )
    story.event(2.1, "get_result", RESPONSE_SENT, status=SUCCEEDED, clock=clock)
    story.status(2.2, (7, 1.1 + clock, SUCCEEDED))
    (goal,) = read(story)
    assert (goal.state, goal.result) == (S.SUCCEEDED, {"sequence": []})
    assert goal.timeline[0].state is S.SENT
    assert goal.ended
    assert goal.ended >= BEGAN + 1.2
    states = [event.state for event in goal.timeline]
    assert states == [S.SENT, S.ACCEPTED, S.EXECUTING, S.SUCCEEDED]


@pytest.mark.parametrize("told_by", ["status", "answer"])
def test_a_goal_that_one_server_rejects_and_another_runs_is_not_rejected(read, told_by) -> None:
    story = Story().sent(1.0, 7).answered(1.1, 7, False)
    if told_by == "answer":
        (goal,) = read(story.answered(1.2, 7, True))
        assert goal.state is S.ACCEPTED
    else:
        story.status(1.3, (7, 1.2, EXECUTING)).status(2.0, (7, 1.2, SUCCEEDED))
        (goal,) = read(story)
        assert goal.state is S.SUCCEEDED
    assert "one of the servers rejected it" in str(goal.timeline)


def test_what_one_of_two_servers_says_is_not_told_of_the_other(read) -> None:
    one, other = (7, 1.10), (7, 1.12)
    story = Story().sent(1.0, 7).status(1.2, (*one, EXECUTING)).status(1.2, (*other, EXECUTING))
    story.cancel(2.0, 7).cancels(2.1, other).status(2.2, (*other, CANCELED))
    story.event(1.5, "get_result", REQUEST_RECEIVED, goal_id=goal_id(7))
    story.event(2.3, "get_result", RESPONSE_SENT, status=CANCELED)
    first, second = sorted(read(story), key=lambda goal: goal.server)
    assert (first.server, first.state, first.result) == (1, S.EXECUTING, None)
    assert (second.server, second.state, second.result) == (2, S.CANCELED, {"sequence": []})
    assert [details(goal) for goal in (first, second)] == [[ASKS], [ASKS, AGREES]]
    assert {goal.sent_by for goal in (first, second)} == {f"program {'01' * 12}"}
    assert {str(goal.goal) for goal in (first, second)} == {"{'order': 7}"}


def test_a_request_to_cancel_all_is_about_those_that_ran(read) -> None:
    story = Story().status(1.0, (1, 0.9, EXECUTING), (2, 0.8, SUCCEEDED)).cancel(1.5, ALL)
    story.status(1.6, (1, 0.9, EXECUTING), (2, 0.8, SUCCEEDED), (3, 1.55, EXECUTING))
    story.cancels(1.7, (1, 0.9))
    goals = {number_of(goal): goal for goal in read(story)}
    assert [details(goals[number]) for number in (1, 2, 3)] == [[ASKS, AGREES], [], []]
    assert goals[1].state is S.CANCELING


def test_a_request_to_cancel_older_goals_is_not_about_newer_ones(read) -> None:
    both = (1, 1.0, EXECUTING), (2, 2.0, EXECUTING)
    story = Story().status(2.1, *both).cancel(2.5, ALL, before=1.5).cancels(2.6, (1, 1.0))
    goals = {number_of(goal): goal for goal in read(story)}
    assert [details(goals[number]) for number in (1, 2)] == [[ASKS, AGREES], []]


def test_what_client_and_server_tell_of_one_request_is_told_once(read) -> None:
    story = Story().status(1.0, (7, 0.9, EXECUTING)).cancel(2.0, 7).cancels(2.1)
    story.event(2.2, "cancel_goal", RESPONSE_RECEIVED, return_code=0)
    story.event(2.3, "cancel_goal", REQUEST_SENT, goal_info=info(7, 0.0))
    (goal,) = read(story)
    assert details(goal) == [ASKS, REFUSES]


def test_a_cancelled_goal_that_is_older_than_the_recording_is_there(read) -> None:
    (goal,) = read(Story().cancel(1.0, 7).cancels(1.1, (7, 0.5)))
    assert (number_of(goal), goal.state, details(goal)) == (7, S.CANCELING, [ASKS, AGREES])


def test_an_answer_that_is_cut_off_is_not_a_refusal(read) -> None:
    story = Story().status(1.0, (7, 0.9, EXECUTING)).cancel(2.0, 7).cancels(2.1, (7, 0.9), cut=-4)
    goals = read(story)
    assert details(goals[0]) == [ASKS]
    assert any("cancel_goal/_service_event are cut off" in problem for problem in goals.problems)


def test_goals_of_before_have_no_time_of_their_end(read) -> None:
    # Each server keeps its latest status for those who come later.
    story = Story().status(9.0, (1, 1.0, SUCCEEDED)).status(9.1, (2, 2.0, ABORTED))
    story.status(9.2, (3, 3.0, ACCEPTED))
    ended, aborted, waits = sorted(read(story), key=number_of)
    assert [goal.state for goal in (ended, aborted, waits)] == [S.SUCCEEDED, S.ABORTED, S.ACCEPTED]
    assert (ended.ended, ended.accepted, aborted.ended) == (None, None, None)
    assert waits.accepted == pytest.approx(BEGAN + 3.0)


def test_a_client_of_cyclonedds_is_not_told_as_a_program(read) -> None:
    story = Story().sent(1.0, 7)
    event = story.messages[0]
    data = event.data.replace(bytes([1]) * 16, bytes([1]) * 8 + bytes(8))
    story.messages[0] = event._replace(data=data)
    (goal,) = read(story)
    assert goal.sent_by == f"client {'01' * 8}"

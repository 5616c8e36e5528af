"""Reading the action topics without decoding, compared with rclpy's real messages."""

from __future__ import annotations

import uuid
from collections.abc import Sequence

import pytest
from action_msgs.msg import GoalInfo, GoalStatus, GoalStatusArray
from builtin_interfaces.msg import Time
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message, serialize_message
from test_msgs.action import Fibonacci, NestedMessage
from test_msgs.msg import BasicTypes
from unique_identifier_msgs.msg import UUID

from actionkit._ros.answers import wire
from actionkit._ros.answers.wire import count_goals, feedback_alone, feedback_goal_id, goal_states

FEW = 64  # up to so many ids each is searched for; more are looked up entry by entry

Goal = tuple[bytes, int]


def status_array(goals: Sequence[Goal], stamp: tuple[int, int] = (1, 2)) -> bytes:
    when = Time(sec=stamp[0], nanosec=stamp[1])
    return bytes(
        serialize_message(
            GoalStatusArray(
                status_list=[
                    GoalStatus(
                        goal_info=GoalInfo(goal_id=UUID(uuid=list(goal_id)), stamp=when),
                        status=status,
                    )
                    for goal_id, status in goals
                ]
            )
        )
    )


def some_goals(count: int) -> list[Goal]:
    return [(uuid.uuid4().bytes, number % 7) for number in range(count)]


@pytest.mark.parametrize("wanted", [1, FEW, FEW + 1, 200])
@pytest.mark.parametrize("count", [0, 1, 2, 3, 70, 1000])
def test_the_states_of_wanted_goals(count: int, wanted: int) -> None:
    goals = some_goals(count)
    strangers = [goal_id for goal_id, _ in some_goals(wanted)]
    message = status_array(goals)
    known = goals[-(wanted // 2 + 1) :]
    ids = {goal_id for goal_id, _ in known} | set(strangers[: max(0, wanted - len(known))])
    assert dict(goal_states(message, ids)) == dict(known)
    assert list(goal_states(message, strangers)) == []
    assert list(goal_states(message, [])) == []


@pytest.mark.parametrize("extra", [0, FEW])
def test_all_the_states_that_there_are(extra: int) -> None:
    goals = [(uuid.uuid4().bytes, status) for status in range(7)]
    wanted = {goal_id for goal_id, _ in goals} | {uuid.uuid4().bytes for _ in range(extra)}
    assert sorted(goal_states(status_array(goals), wanted)) == sorted(goals)


@pytest.mark.parametrize("count", [0, 1, 2, 3, 70, 1000])
def test_goals_are_counted_by_their_status(count: int) -> None:
    goals = some_goals(count)
    message = status_array(goals)
    assert count_goals(message, ()) == 0
    assert count_goals(message, range(7)) == count
    for codes in ((3, 5), (6,)):
        assert count_goals(message, codes) == sum(status in codes for _, status in goals)
    assert count_goals(message[:-1], range(7)) == max(0, count - 1)


@pytest.mark.parametrize("count", [0, 1, 2, 3, 70])
@pytest.mark.parametrize("stamp", [(1, 2), (-(2**31), 2**32 - 1)])
def test_all_that_a_status_array_has(count: int, stamp: tuple[int, int]) -> None:
    goals = some_goals(count)
    message = status_array(goals, stamp)
    assert list(wire.goals(message)) == [(goal_id, *stamp, status) for goal_id, status in goals]
    assert len(list(wire.goals(message[:-1]))) == max(0, count - 1)


@pytest.mark.parametrize("form", [bytes, bytearray, memoryview])
def test_messages_come_in_any_form_of_bytes(form: type) -> None:
    goals = some_goals(3)
    assert dict(goal_states(form(status_array(goals)), dict(goals))) == dict(goals)
    assert feedback_goal_id(form(bytes(4) + goals[0][0])) == goals[0][0]


ids = st.integers(0, 2**32).map(lambda seed: uuid.uuid5(uuid.NAMESPACE_OID, str(seed)).bytes)
stamps = st.tuples(st.integers(-(2**31), 2**31 - 1), st.integers(0, 2**32 - 1))


@settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(
    st.lists(st.tuples(ids, st.integers(0, 6)), unique_by=lambda goal: goal[0], max_size=150),
    st.sets(ids, max_size=100),
    st.floats(0, 1),
    stamps,
)
def test_any_goals_among_any_others(
    goals: list[Goal], strangers: set[bytes], share: float, stamp: tuple[int, int]
) -> None:
    own = goals[: round(share * len(goals))]
    wanted = {goal_id for goal_id, _ in own} | (strangers - {goal_id for goal_id, _ in goals})
    assert sorted(goal_states(status_array(goals, stamp), wanted)) == sorted(own)


@given(ids, st.lists(st.integers(-(2**31), 2**31 - 1), max_size=50))
def test_the_goal_of_a_feedback_message(goal_id: bytes, sequence: list[int]) -> None:
    feedback = Fibonacci.Impl.FeedbackMessage(
        goal_id=UUID(uuid=list(goal_id)), feedback=Fibonacci.Feedback(sequence=sequence)
    )
    assert feedback_goal_id(serialize_message(feedback)) == goal_id


def test_the_goal_of_a_feedback_message_of_another_type() -> None:
    goal_id = uuid.uuid4().bytes
    feedback = NestedMessage.Impl.FeedbackMessage(goal_id=UUID(uuid=list(goal_id)))
    assert feedback_goal_id(serialize_message(feedback)) == goal_id


@given(ids, st.lists(st.integers(-(2**31), 2**31 - 1), max_size=50))
def test_feedback_without_its_goal_id(goal_id: bytes, sequence: list[int]) -> None:
    feedback = Fibonacci.Feedback(sequence=sequence)
    message = Fibonacci.Impl.FeedbackMessage(goal_id=UUID(uuid=list(goal_id)), feedback=feedback)
    alone = feedback_alone(serialize_message(message))
    assert deserialize_message(alone, Fibonacci.Feedback) == feedback


@given(ids, st.integers(-(2**63), 2**63 - 1), st.floats(allow_nan=False), st.booleans())
def test_feedback_without_its_goal_id_keeps_its_alignment(
    goal_id: bytes, number: int, fraction: float, flag: bool
) -> None:
    feedback = NestedMessage.Feedback(
        nested_field=BasicTypes(bool_value=flag, int64_value=number, float64_value=fraction)
    )
    message = NestedMessage.Impl.FeedbackMessage(
        goal_id=UUID(uuid=list(goal_id)), feedback=feedback
    )
    alone = feedback_alone(serialize_message(message))
    assert deserialize_message(alone, NestedMessage.Feedback) == feedback


# --- messages that are cut off, or no messages at all ------------------------------------------


@pytest.mark.parametrize("extra", [0, FEW])
def test_of_a_message_that_is_cut_off_the_whole_entries_are_read(extra: int) -> None:
    goals = [(uuid.uuid4().bytes, status) for status in (2, 4, 5)]
    wanted = {goal_id for goal_id, _ in goals} | {uuid.uuid4().bytes for _ in range(extra)}
    message = status_array(goals)
    counts = [len(list(goal_states(message[:length], wanted))) for length in range(len(message))]
    assert counts == sorted(counts)
    assert set(counts) == {0, 1, 2}
    for length in range(len(message)):
        assert set(goal_states(message[:length], wanted)) <= set(goals)


@st.composite
def torn(draw: st.DrawFn) -> tuple[bytes, set[bytes]]:
    """Return bytes of any kind, and ids of which some are in them anywhere."""
    message = draw(st.binary(max_size=200))
    places = draw(st.lists(st.integers(0, max(0, len(message) - 16)), max_size=FEW + 10))
    wanted = {message[place : place + 16] for place in places} | draw(st.sets(ids, max_size=FEW))
    return message, {goal_id for goal_id in wanted if len(goal_id) == 16}


@given(torn())
def test_any_bytes_are_read_without_an_error(given: tuple[bytes, set[bytes]]) -> None:
    message, wanted = given
    assert {goal_id for goal_id, _ in goal_states(message, wanted)} <= wanted
    assert len(feedback_goal_id(message)) <= 16
    assert len(feedback_alone(message)) <= max(4, len(message))

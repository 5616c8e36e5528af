"""Recordings of real servers tell what their clients saw (C6.3)."""

from __future__ import annotations

from pathlib import Path

import pytest
from rosbags.rosbag2 import StoragePlugin

import actionkit as ak
from actionkit import GoalState
from tests.client.test_two_servers import sees
from tests.recordings import bags
from tests.recordings.recorder import recording

S = GoalState
NAMES = ("/arm", "/gripper", "/base")


@pytest.mark.parametrize("storage", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
def test_a_recording_tells_what_happened_to_each_goal(
    storage: StoragePlugin, ros_domain, action_server, make_client, tmp_path: Path
) -> None:
    action_server("fibonacci", action_name="arm", period=0.02)
    action_server("aborts", action_name="gripper")
    action_server("never_finishes", action_name="base")
    with recording(ros_domain, *NAMES) as recorder:
        arm, gripper, base = (make_client(name=name) for name in NAMES)
        recorder.sees(1)
        long = base.call_async({"order": 9}, timeout=60)
        assert long.wait_accepted(20)
        ended = [client.call_async({"order": 4}, timeout=30).outcome() for client in (arm, gripper)]
        long.cancel()
        ended.insert(0, long.outcome(30))
        recorder.has_ends(3)
    goals = ak.read_goals(bags.folder(tmp_path / "bag", recorder.messages, storage))
    said = [(goal.goal_id, goal.state) for goal in goals]
    assert said == [(outcome.goal_id, outcome.state) for outcome in ended]
    assert [goal.state for goal in goals] == [S.CANCELED, S.SUCCEEDED, S.ABORTED]
    assert [goal.action_name for goal in goals] == ["/base", "/arm", "/gripper"]
    cancelled, succeeded, _ = goals
    states = [event.state for event in cancelled.timeline if event.state is not S.FEEDBACK]
    assert states == [state for state in S if state in states]  # no state comes back
    assert {S.ACCEPTED, S.CANCELED} <= set(states)
    feedback = [event for event in succeeded.timeline if event.state is S.FEEDBACK]
    assert feedback[0].detail == "#1"
    assert len(feedback) == 2  # the first and the last
    assert cancelled.ended
    assert succeeded.ended
    assert succeeded.ended < cancelled.ended


def test_a_goal_that_two_servers_have_is_two_goals(
    ros_domain, action_server, make_client, tmp_path: Path
) -> None:
    action_server("fibonacci", period=0.05)
    never = action_server("never_finishes")
    with recording(ros_domain, "/fibonacci") as recorder:
        client = make_client()
        recorder.sees(2)
        assert sees(client, 2)
        future = client.call_async({"order": 2}, timeout=60)
        never.wait_for("accepted")
        recorder.has_ends(1)
        future.cancel()
        future.outcome(30)
        recorder.has_ends(2)
    goals = ak.read_goals(bags.mcap(tmp_path / "x.mcap", recorder.messages))
    assert {goal.goal_id for goal in goals} == {future.goal_id}
    by_server = {goal.server: goal.state for goal in goals}
    assert sorted(by_server) == [1, 2]
    assert sorted(by_server.values()) == [S.CANCELED, S.SUCCEEDED]

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

LONG = {"feedback": 1000, "period": 0.05}
SCRIPT = [[{"feedback": 3, "period": 0.05}], [{"feedback": 2}, {"abort": [1]}], [LONG]]


@pytest.mark.parametrize("storage", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
def test_a_recording_tells_what_happened_to_each_goal(
    storage: StoragePlugin, ros_domain, action_server, make_client, tmp_path: Path
) -> None:
    action_server("scripted", script=SCRIPT)
    action_server("fibonacci", action_name="arm", period=0.02)
    with recording(ros_domain, "/fibonacci", "/arm") as recorder:
        client, arm = make_client(), make_client(name="arm")
        recorder.sees(1)
        ended = [client.call_async({"order": order}, timeout=30).outcome() for order in (1, 2)]
        long = client.call_async({"order": 3}, timeout=60)
        assert long.wait_accepted(20)
        ended.append(arm.call_async({"order": 3}, timeout=30).outcome())
        long.cancel()
        ended.insert(2, long.outcome(30))
        recorder.has_ends(4)
    goals = ak.read_goals(bags.folder(tmp_path / "bag", recorder.messages, storage))
    said = [(goal.goal_id, goal.state) for goal in goals]
    assert said == [(outcome.goal_id, outcome.state) for outcome in ended]
    assert [goal.action_name for goal in goals] == ["/fibonacci"] * 3 + ["/arm"]
    states = [event.state for event in goals[2].timeline if event.state is not GoalState.FEEDBACK]
    assert states == [S for S in GoalState if S in states]  # no state comes back
    assert {GoalState.ACCEPTED, GoalState.CANCELED} <= set(states)
    feedback = [event for event in goals[0].timeline if event.state is GoalState.FEEDBACK]
    assert [event.detail for event in feedback] == ["#1", "#3"]  # the first and the last
    assert goals[3].ended
    assert goals[2].ended
    assert goals[3].ended < goals[2].ended


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
    assert sorted(by_server.values()) == [GoalState.CANCELED, GoalState.SUCCEEDED]

"""With any lost packets, every given-up goal is cancelled, and no goal counts as lost."""

from __future__ import annotations

import pytest

from actionkit._goal.effects import End
from tests.hunting import many
from tests.unit.network_life import NetworkLife

_LIVES = 8


@pytest.mark.parametrize("block", range(10))
def test_goals_over_a_network_that_loses_packets(block: int) -> None:
    lives = many(_LIVES)
    for seed in range(lives * block, lives * (block + 1)):
        life = NetworkLife(seed)
        life.run()
        for attempt in life.attempts:
            key = attempt.goal_id.bytes
            told = f"seed {seed}, {life.loss:.0%} lost:\n{life.told_of(attempt)}"
            on_server = life.goals.get(key)
            given_up = attempt.goal.cancel_reason is not None or key in life.endings
            assert not (given_up and on_server and on_server.runs), f"left running, {told}"
            ending = life.endings.get(key)
            if ending is not None:
                assert ending.end not in (End.RESULT_LOST, End.LOST), told

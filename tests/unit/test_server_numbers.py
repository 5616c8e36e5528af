"""Servers on one action name are told apart by their status messages (C6.3)."""

from __future__ import annotations

import random

from actionkit._ros.others_goals.server_numbers import GoalKey, ServerNumbers

ACCEPTED, EXECUTING, SUCCEEDED = 1, 2, 4


def key(number: int, stamp: int = 0) -> GoalKey:
    return bytes([number]) * 16, stamp or number, 0


def test_messages_with_a_goal_in_common_come_from_one_server() -> None:
    servers = ServerNumbers()
    assert servers.of({key(1): EXECUTING}) == 1
    assert servers.of({key(1): SUCCEEDED, key(2): ACCEPTED}) == 1
    assert servers.of({key(2): EXECUTING}) == 1
    assert len(servers) == 1


def test_one_that_does_not_have_a_running_goal_is_another_server() -> None:
    servers = ServerNumbers()
    assert servers.of({key(1, 5): EXECUTING}) == 1
    assert servers.of({key(1, 6): EXECUTING}) == 2  # the same goal, stamped by another
    assert servers.of({key(1, 5): SUCCEEDED}) == 1
    assert servers.of({key(1, 6): SUCCEEDED}) == 2


def test_one_server_may_forget_what_has_ended() -> None:
    servers = ServerNumbers()
    assert servers.of({key(1): SUCCEEDED}) == 1
    assert servers.of({key(2): EXECUTING}) == 1


def test_servers_with_any_goals_are_told_apart() -> None:
    draw = random.Random(4)
    for _ in range(100):
        servers, said = ServerNumbers(), {}
        arrays: dict[int, dict[GoalKey, int]] = {n: {} for n in range(3)}
        for step in range(60):
            real = draw.randrange(3)
            running = [k for k, code in arrays[real].items() if code == EXECUTING]
            if len(running) > 1 and draw.random() < 0.5:  # one runs on: so it cannot be mistaken
                arrays[real][running[0]] = SUCCEEDED
            else:
                arrays[real][key(draw.randrange(200), 1000 * step + real)] = EXECUTING
            said.setdefault(real, set()).add(servers.of(dict(arrays[real])))
        assert all(len(numbers) == 1 for numbers in said.values())
        assert len(set.union(*said.values())) == len(said)

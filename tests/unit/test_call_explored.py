"""Every state of a call and its goals keeps the promises; and the check finds broken code (C2.8).

Some states are visited by default; many more, and those of broken code, with `--long`. All of them:
`python -m tests.unit.explore_call confirmed_stopped 2 1 9999999`.
"""

from __future__ import annotations

from itertools import product

import pytest

from tests.hunting import many
from tests.unit.explore_call import (
    Attached,
    LeftAlone,
    Refused,
    Rejoined,
    Replaced,
    World,
    explore,
    hunt,
)

POLICIES = ("never_accepted", "confirmed_stopped", "server_gone", "always")
SMALL = 1_000
"""States, those that are reached soonest."""
MANY = 20_000


@pytest.mark.parametrize(
    ("resend", "servers", "most"),
    [
        *product(POLICIES, (1, 2), [SMALL]),
        pytest.param("confirmed_stopped", 1, MANY, marks=pytest.mark.long),
        pytest.param("server_gone", 2, MANY, marks=pytest.mark.long),
    ],
)
@pytest.mark.timeout(900)
def test_no_promise_is_broken(resend: str, servers: int, most: int) -> None:
    states, transitions = explore(resend, attempts=2, servers=servers, most=most)
    assert transitions > states >= SMALL


KINDS = {
    Refused: ("never_accepted", 1),
    Attached: ("never_accepted", 1),
    LeftAlone: ("never_accepted", 1),
    Rejoined: ("confirmed_stopped", 2),
    Replaced: ("always", 2),
}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("servers", [1, 2])
def test_no_promise_is_broken_for_other_kinds(kind: type[World], servers: int) -> None:
    resend, attempts = KINDS[kind]
    explore(resend, attempts=attempts, servers=servers, most=SMALL, kind=kind)
    hunt(resend, attempts, servers, walks=many(200), kind=kind)


HUNTS = (
    ("confirmed_stopped", 2, 1),
    ("confirmed_stopped", 3, 2),
    ("server_gone", 3, 1),
    ("server_gone", 3, 2),
    ("always", 3, 2),
)
"""How goals are sent again, the attempts, and the servers."""


@pytest.mark.parametrize("hunting", HUNTS)
def test_no_promise_is_broken_on_long_ways(hunting: tuple[str, int, int]) -> None:
    assert hunt(*hunting, walks=many(500)) > many(15_000)


LUCKY = (
    (("server_gone", 3, 1), 0),
    (("confirmed_stopped", 2, 1), 0),
    (("confirmed_stopped", 3, 2), 1),
    (("confirmed_stopped", 3, 2), 4),
    (("server_gone", 3, 2), 6),
)
"""Seeds of walks that find most of the broken code soon. After a change others may."""


@pytest.mark.long
@pytest.mark.timeout(900)
def test_no_promise_is_broken_anywhere() -> None:
    """First where broken code is found soonest: each mutant of `tests/mutants` is found here."""
    for kind, (resend, attempts) in KINDS.items():
        hunt(resend, attempts, 1, walks=300, kind=kind)
    explore("never_accepted", attempts=1, servers=2, most=SMALL, kind=Refused)
    for hunting, seed in LUCKY:
        hunt(*hunting, walks=300, seed=seed)
    explore("confirmed_stopped", attempts=2, servers=1, most=3000)
    explore("confirmed_stopped", attempts=2, servers=2, most=6000)
    for seed, hunting in product(range(3), HUNTS):
        hunt(*hunting, walks=300, seed=seed)

"""Every state of one goal and its servers keeps the promises; and the check finds broken code.

The states that are reached soonest are visited by default, many more with `--long`.
"""

from __future__ import annotations

from typing import Any

import pytest

from actionkit import Timeouts
from actionkit._goal.effects import Timer
from actionkit._goal.stages import CancelReason
from tests.hunting import many
from tests.unit.explore_goal import begin, hunt
from tests.unit.exploring import explore

SMALL = 250
"""States, those that are reached soonest."""
MANY = 8_000
LIMITS = Timeouts(accept=2.5, feedback=3.0, result=3.0)
WORLDS: dict[str, dict[str, Any]] = {
    "one server": {"servers": 1},
    "two servers": {"servers": 2},
    "attached to one": {"servers": 1, "kind": "attach"},
    "attached to one of two": {"servers": 2, "kind": "attach"},
    "one of two, left alone": {"servers": 2, "kind": "left alone"},
    "another comes": {"servers": 1, "later": "new"},
    "another comes that was sent it": {"servers": 1, "later": "late"},
    "a third one comes": {"servers": 2, "later": "new"},
    "with limits": {"servers": 2, "timeouts": LIMITS},
}


@pytest.mark.parametrize("world", WORLDS)
def test_no_promise_is_broken(world: str) -> None:
    states, transitions = explore(begin(**WORLDS[world]), most=SMALL)
    assert transitions > states >= SMALL
    assert hunt(begin(**WORLDS[world]), walks=many(10)) > many(10)


LONG_SILENCE = ("long silence", None)
CANCELS = ("give up", CancelReason.CANCELLED)
LATE = ("give up", CancelReason.DEADLINE)
CLOSES = ("give up", CancelReason.CLOSED)
FOUND: dict[str, tuple[str, list[tuple[str, Any]]]] = {
    "no acceptance came, one server has ended it, the other does not have it": (
        "two servers",
        [("accepts unseen", 1)],
    ),
    "what its server answered before it accepted it comes after a silence": (
        "one server",
        [
            CANCELS,
            ("cancel again", None),
            ("cancel: the answer is late", (0, 1)),
            ("accepts unseen", 0),
            ("answers cancel", (0, 0)),
            ("is silent", 0),
            ("cancel: the late answer comes", (0, 0)),
        ],
    ),
    "one server is dead, and the other does not say that it has rejected it": (
        "two servers",
        [("dies", 0)],
    ),
    "the server that has ended it says so again, after the other was lost": (
        "one of two, left alone",
        [CANCELS, ("dies", 1)],
    ),
    "a server was silent, and ends it while the other is out of sight": (
        "attached to one of two",
        [("is silent", 0), ("hangs", 1), ("ends", 0), ("result", (0, 0))],
    ),
    "one server has ended it, and the other is lost": (
        "two servers",
        [
            ("accepts unseen", 0),
            ("accepts", 1),
            ("ends", 0),
            LATE,
            ("result", (0, 0)),
            ("is silent", 1),
        ],
    ),
    "a server accepts it after it was asked to cancel it, and before the other cancels it": (
        "two servers",
        [
            CANCELS,
            ("accepts unseen", 1),
            ("cancel: the answer is late", (0, 0)),
            ("accepts", 0),
            ("answers cancel", (1, 0)),
        ],
    ),
    "a server was out of sight when the other was asked to cancel it": (
        "two servers",
        [
            ("accepts", 0),
            ("accepts unseen", 1),
            ("hangs", 0),
            CANCELS,
            ("comes", 0),
            ("answers cancel", (1, 0)),
        ],
    ),
    "one server has ended it, the other has refused, and its caller gives up again": (
        "two servers",
        [
            ("accepts unseen", 1),
            ("its answer comes", 1),
            ("accepts", 0),
            ("ends", 0),
            ("result", (0, 1)),
            ("refuses to cancel", (1, 0)),
            CLOSES,
        ],
    ),
    "its caller gives up again before one server answers the request before that": (
        "two servers",
        [
            ("accepts unseen", 0),
            ("is silent", 1),
            ("accepts unseen", 1),
            ("its answer comes", 0),
            ("refuses to cancel", (1, 0)),
            CLOSES,
            ("answers cancel", (0, 0)),
        ],
    ),
    "one server has ended it, the other is back after an outage": (
        "two servers",
        [
            ("accepts", 0),
            ("accepts", 1),
            ("ends", 0),
            ("result", (0, 1)),
            ("hangs", 1),
            ("refuses to cancel", (0, 0)),
            CANCELS,
            ("refuses to cancel", (0, 0)),
            ("comes", 1),
        ],
    ),
    "one server has rejected it, which ended it, and the other accepts it after that": (
        "two servers",
        [("rejects", 0), ("accepts", 1)],
    ),
    "one server has ended it for a minute, and the other is out of sight": (
        "two servers",
        [
            CANCELS,
            ("accepts", 1),
            ("ends", 1),
            ("hangs", 0),
            ("result", (1, 1)),
            LONG_SILENCE,
            LONG_SILENCE,
            LONG_SILENCE,
            ("result", (1, 1)),
            LONG_SILENCE,
        ],
    ),
    "one server has ended it, was silent, and the other is out of sight": (
        "two servers",
        [
            CLOSES,
            ("accepts", 1),
            ("hangs", 0),
            ("ends", 1),
            ("result", (1, 0)),
            ("is silent", 1),
            ("is not silent any more", None),
            LONG_SILENCE,
            ("timer", Timer.REASK),
        ],
    ),
    "its server was silent, has forgotten it, and the other had rejected it unheard": (
        "two servers",
        [("accepts", 0), ("ends", 0), ("forgets", 0), ("is silent", 0)],
    ),
    "what one server denied while the other was out of sight counts when that is back": (
        "two servers",
        [
            ("accepts", 0),
            ("accepts unseen", 1),
            CANCELS,
            ("is silent", 1),
            ("ends", 0),
            ("answers cancel", (1, 0)),
            ("hangs", 1),
            ("result", (0, 1)),
            LONG_SILENCE,
            LONG_SILENCE,
            LONG_SILENCE,
            ("result", (0, 1)),
            ("comes", 1),
            ("timer", Timer.REASK),
        ],
    ),
    "a goal that is taken back counts as one of the server that has rejected it": (
        "two servers",
        [
            ("rejects", 1),
            ("hangs", 1),
            ("accepts unseen", 0),
            ("its answer comes", 0),
            ("comes", 1),
            ("seems restarted", 0),
            ("answers cancel", (0, 0)),
            ("cancel: the answer is late", (1, 0)),
            LONG_SILENCE,
            LONG_SILENCE,
            ("timer", Timer.REASK),
            ("timer", Timer.REASK),
            ("cancel: the late answer comes", (1, 0)),
            ("timer", Timer.REASK),
        ],
    ),
    "its caller gives up again after a refusal, before the other server answers": (
        "two servers",
        [
            ("accepts", 1),
            ("accepts", 0),
            CANCELS,
            ("refuses to cancel", (0, 0)),
            ("timer", Timer.CANCEL),
            CLOSES,
            ("answers cancel", (1, 0)),
        ],
    ),
    "its caller gives up again when one server is gone, and the other refuses": (
        "a third one comes",
        [
            ("comes", 2),
            ("timer", Timer.ACCEPT),
            ("cancel again", None),
            ("accepts", 0),
            ("is silent", 1),
            ("answers cancel", (0, 1)),
            ("result: the answer is late", (1, 1)),
            ("dies", 0),
            ("result: the late answer comes", (1, 0)),
            ("result", (2, 1)),
            ("result: the answer is late", (1, 1)),
            ("accepts unseen", 1),
            ("result", (2, 0)),
            ("refuses to cancel", (1, 1)),
            ("refuses to cancel", (1, 0)),
            ("result: the late answer comes", (1, 0)),
            CANCELS,
        ],
    ),
}
"""Ways on which a promise was once broken."""


@pytest.mark.parametrize("case", FOUND)
def test_what_was_once_broken(case: str) -> None:
    name, way = FOUND[case]
    world = begin(**WORLDS[name])
    for step in way:
        assert step in world.events()
        world.happens(*step)
        world.check()


@pytest.mark.long
@pytest.mark.timeout(900)
@pytest.mark.parametrize("world", WORLDS)
def test_no_promise_is_broken_in_many_states(world: str) -> None:
    states, _ = explore(begin(**WORLDS[world]), most=MANY)
    assert states >= MANY

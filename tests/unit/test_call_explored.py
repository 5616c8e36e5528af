"""Every state of a call and its goals keeps the promises; and the check finds broken code (C2.8).

Some states are visited by default; many more, and those of broken code, with `--long`. All of them:
`python -m tests.unit.explore_call confirmed_stopped 2 1 9999999`.
"""

from __future__ import annotations

import inspect
import textwrap
from itertools import product
from typing import Any

import pytest

from actionkit._calls.machine import CallMachine
from actionkit._goal.facts import GoalFacts
from actionkit._goal.machine import Goal
from tests.hunting import many
from tests.unit.explore_call import (
    Attached,
    Broken,
    LeftAlone,
    Refused,
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
    Replaced: ("always", 2),
}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("servers", [1, 2])
def test_no_promise_is_broken_for_other_kinds(kind: type[World], servers: int) -> None:
    resend, attempts = KINDS[kind]
    explore(resend, attempts=attempts, servers=servers, most=SMALL, kind=kind)
    hunt(resend, attempts, servers, walks=many(200), kind=kind)


def broken(cls: type, name: str, old: str, new: str) -> Any:
    """Return a method of a class with a part of its source replaced."""
    found = inspect.getattr_static(cls, name)
    function = found.fget if isinstance(found, property) else found
    source = textwrap.dedent(inspect.getsource(function))
    assert source.count(old) == 1, source
    made: dict[str, Any] = {}
    exec(source.replace(old, new), function.__globals__, made)
    return made[name]  # `@property` is part of the source


MUTANTS = {
    "a goal is sent that nobody wants": (
        CallMachine,
        "turn",
        "if self.unwanted and not self._attaches:",
        "if False:",
    ),
    "a goal is sent when the time is up": (
        CallMachine,
        "turn",
        "self._is_late(now) or ",
        "",
    ),
    "a goal waits for its turn while no server is there": (
        CallMachine,
        "server_lost",
        "self._await_server(now) if held_up or self.phase is Phase.QUEUED else []",
        "[]",
    ),
    "a server that is there is waited for": (
        CallMachine,
        "server_ready",
        "if self.phase is not Phase.WAITING:",
        "if self.phase is not Phase.WAITING or self.earlier:",
    ),
    "nobody is told that another type is served": (
        CallMachine,
        "type_mismatch",
        "if self.phase is not Phase.WAITING:",
        "if True:",
    ),
    "who waited for a server in vain waits on": (
        CallMachine,
        "waited",
        ", cx.StopRetrying()]",
        "]",
    ),
    "the time was up, where no server was there": (
        CallMachine,
        "waited",
        "if self.phase is Phase.QUEUED:",
        "if True:",
    ),
    "no server was there, where the goal waited for its turn": (
        CallMachine,
        "_too_late",
        "fx.End.DEADLINE,",
        "fx.End.NO_SERVER,",
    ),
    "no server was there, though a goal was sent before": (
        CallMachine,
        "waited",
        "self._last, self._server_limit",
        "None, self._server_limit",
    ),
    "what is over waits for its turn": (
        CallMachine,
        "_end",
        "[cx.StopRetrying(), *self._finish()]",
        "self._finish()",
    ),
    "a goal waits for its turn, though an earlier one has succeeded": (
        CallMachine,
        "late_result",
        "effects: list[cx.Effect] = [cx.StopRetrying()]",
        "effects: list[cx.Effect] = []",
    ),
    "a goal is sent while an earlier one may run": (
        CallMachine,
        "may_send",
        "return all(",
        "return True or all(",
    ),
    "a goal is sent while the server of an earlier one is in sight": (
        CallMachine,
        "_allows_another",
        " and facts.is_lost_with_server",
        "",
    ),
    "a guess that a server was restarted lets a goal be sent": (
        GoalFacts,
        "is_lost_with_server",
        " and self.gone",
        "",
    ),
    "a goal is sent while the result of an earlier one may come": (
        CallMachine,
        "_allows_another",
        "return ended_as is None or",
        "return True or",
    ),
    "only the last attempt is looked at": (
        CallMachine,
        "ended",
        "(*self.earlier, attempt)",
        "(attempt,)",
    ),
    "a goal that has ended is not looked at while its result may come": (
        CallMachine,
        "ended",
        " or each.goal.awaits_result_of",
        "",
    ),
    "who cancels waits for no earlier goal": (
        CallMachine,
        "_end",
        " and self.confirming",
        " and False",
    ),
    "the end names no goal that may run": (
        CallMachine,
        "_finish",
        "self.goals.reports",
        "()",
    ),
    "a late success is not heard": (
        CallMachine,
        "late_result",
        "if attempt not in self.earlier or",
        "if True or",
    ),
    "a call that nobody wants is tried again": (
        CallMachine,
        "judged",
        "if why:",
        "if False:",
    ),
    "a goal that was replaced is sent again": (
        CallMachine,
        "judged",
        "if self._replacement is not None:",
        "if False:",
    ),
    "a goal waits to be sent though another was sent in its place": (
        CallMachine,
        "replace_by",
        "if self.attempt is not None else self.give_up",
        "if True else self.give_up",
    ),
    "a goal that was replaced looks like a failure": (
        CallMachine,
        "_judge",
        "if ending.end in _STOPPED and self._is_replaced:",
        "if False:",
    ),
    "a goal counts as replaced by one that was refused": (
        CallMachine,
        "_is_replaced",
        "(call.phase is not Phase.ENDED or call.goals.accepted)",
        "True",
    ),
    "a goal that is left alone is cancelled when its server is back": (
        Goal,
        "server_lost",
        "self.forget() if self._is_left_alone else []",
        "[]",
    ),
    "a goal that is left alone is cancelled at the deadline": (
        Goal,
        "give_up",
        "(self._is_left_alone and why is not CancelReason.CANCELLED)",
        "False",
    ),
    "a late acceptance is not cancelled": (
        Goal,
        "_shown",
        "if self.unwanted:",
        "if False:",
    ),
    "a late acceptance is not cancelled after another server's refusal": (
        Goal,
        "unwanted",
        " or self._refused_reason is not None",
        "",
    ),
    "a lost goal counts as stopped": (
        GoalFacts,
        "may_run",
        "if self.is_over:",
        "if self.is_over or self.lost:",
    ),
    "an unanswered goal counts as stopped": (
        GoalFacts,
        "is_over",
        "(self.accepted or self.noes < self.servers)",
        "self.accepted",
    ),
    "that a server does not know a goal counts as its end": (
        Goal,
        "_unknown_so_far",
        "self._unknown_to_server = self._denied_lately = True",
        "self.facts.noes = 1",
    ),
    "a lost goal is not cancelled when its server is back": (
        Goal,
        "_ask_about_lost",
        "[fx.AskCancel(), ",
        "[",
    ),
    "giving up asks for no cancel": (
        Goal,
        "_cancel",
        "else fx.AskCancel()",
        "else fx.AskResult()",
    ),
    "one of two servers rejects it, and so it does not run": (
        GoalFacts,
        "is_over",
        "self.noes < self.servers",
        "self.noes < 1",
    ),
    "one of two servers has ended it, and so it does not run": (
        Goal,
        "_stopped_everywhere",
        "if facts.undecided:",
        "if facts.ends:",
    ),
    "a second server that accepts it does not count": (
        GoalFacts,
        "runs_seen",
        "max(self.yeses, int(self.accepted))",
        "int(self.accepted)",
    ),
    "a second server that may accept it does not count for who gave up": (
        GoalFacts,
        "may_run",
        " or (self.given_up and self.undecided)",
        "",
    ),
    "who gave up does not wait for a second server": (
        Goal,
        "_end_here",
        "if self.cancel_reason is None:",
        "if True:",
    ),
    "a second server is not asked to cancel it": (
        Goal,
        "_end_here",
        "fx.AskCancel(), ",
        "",
    ),
    "of two servers one that is out of sight does not count": (
        Goal,
        "_stopped_everywhere",
        " and not facts.away",
        "",
    ),
    "an abandoned goal is not known to be left": (
        Goal,
        "_leave",
        "self.lose_touch()",
        "pass",
    ),
    "the deadline does not end a pause": (
        CallMachine,
        "waited",
        "if self.phase is Phase.PAUSING",
        "if False",
    ),
    "the deadline does not reach a goal that is being cancelled": (
        Goal,
        "give_up",
        "if why in FINAL:",
        "if why is CancelReason.CLOSED:",
    ),
    "a goal that nobody waits for is waited for, as its cancel was refused": (
        Goal,
        "_believe_refusal",
        "if self._final_reason is not None:",
        "if False:",
    ),
}


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


@pytest.mark.parametrize("mutant", MUTANTS)
def test_there_is_such_code_to_break(mutant: str) -> None:
    assert broken(*MUTANTS[mutant])  # so that a change of the code is noticed without `--long`


@pytest.mark.long
@pytest.mark.timeout(900)  # some are found after a minute of an idle processor
@pytest.mark.parametrize("mutant", MUTANTS)
def test_broken_code_is_found(mutant: str, monkeypatch: pytest.MonkeyPatch) -> None:
    cls, name, old, new = MUTANTS[mutant]
    monkeypatch.setattr(cls, name, broken(cls, name, old, new))
    with pytest.raises(Broken):
        look_everywhere()


LUCKY = (
    (("server_gone", 3, 1), 0),
    (("confirmed_stopped", 2, 1), 0),
    (("confirmed_stopped", 3, 2), 1),
    (("confirmed_stopped", 3, 2), 4),
    (("server_gone", 3, 2), 6),
)
"""Seeds of walks that find most of the broken code soon. After a change others may."""


def look_everywhere() -> None:
    """Where most is found, first."""
    for kind, (resend, attempts) in KINDS.items():
        hunt(resend, attempts, 1, walks=300, kind=kind)
    explore("never_accepted", attempts=1, servers=2, most=SMALL, kind=Refused)
    for hunting, seed in LUCKY:
        hunt(*hunting, walks=300, seed=seed)
    explore("confirmed_stopped", attempts=2, servers=1, most=3000)
    explore("confirmed_stopped", attempts=2, servers=2, most=6000)
    for seed, hunting in product(range(20), HUNTS):
        hunt(*hunting, walks=300, seed=seed)
    explore("confirmed_stopped", attempts=2, servers=1, most=MANY)

"""May another goal be sent? The answers of all who ask, as `docs/architecture.md` has them (C4.2).

Each row of its tables is a way of a goal, and each column somebody who asks. The goals here are
real state machines, and each who asks is the code itself.
"""

from __future__ import annotations

import uuid
from collections.abc import Callable
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, cast

import pytest

from actionkit import GoalState, RetryPolicy, Timeouts
from actionkit._calls.futures.call_view import GoalsOfCall
from actionkit._calls.retries.retry import may_try_again
from actionkit._calls.sending.machine import CallMachine
from actionkit._calls.sending.replacing import not_stopped
from actionkit._goal.effects import LastNews
from actionkit._goal.machine import Goal
from actionkit._goal.stages import Stage
from actionkit._model.cancel_answer import CancelAnswer
from actionkit.agents._tool_calls.goals import Goals, ToolGoal
from actionkit.trees._runs import Runs
from tests.tables import Page
from tests.unit.call_life import CallLife

POLICIES = ("never_accepted", "confirmed_stopped", "server_gone", "always")
SENT = "sent or accepted"
ATTEMPTS: dict[tuple[str, str], tuple[LastNews, ...]] = {
    ("rejected", "-"): tuple(LastNews),
    (SENT, "it has ended, or its server says twice that it does not know it"): (LastNews.STOPPED,),
    (SENT, "it was lost: its server is gone, or seems so"): (LastNews.SERVER_GONE,),
    (SENT, "nothing, so it may run"): (LastNews.NOTHING, LastNews.UNKNOWN_TO_SERVER),
}


# --- ways of a goal ----------------------------------------------------------------------------


def sent(servers: int = 1, yeses: int = 0) -> Goal:
    goal = Goal(uuid.uuid4(), Timeouts())
    goal.sent(0.0, servers)
    for _ in range(yeses):
        goal.accepted(1.0)
    return goal


def unknown_so_far() -> Goal:
    goal = sent()
    goal.cancel_answered(CancelAnswer.UNKNOWN_GOAL, 2.0, asked_at=1.0)
    return goal


def lost(servers: int = 1, yeses: int = 1, away: int = 0) -> Goal:
    goal = sent(servers, yeses)
    goal.servers_changed(servers, away)
    goal.server_lost("silent, or gone", 2.0)
    return goal


def back() -> Goal:
    goal = lost(away=1)
    goal.servers_changed(1, 0)
    goal.server_back(3.0)
    return goal


def unfollowed(goal: Goal) -> Goal:
    goal.lose_touch()
    return goal


def ended(state: GoalState, servers: int = 1, yeses: int = 1) -> Goal:
    goal = sent(servers, yeses)
    goal.result(state, None, 2.0, asked_at=1.0, everybody=servers == 1)
    return goal


def rejected(servers: int = 1) -> Goal:
    goal = sent(servers)
    goal.rejected(1.0)
    return goal


def seen_to_end(state: GoalState) -> Goal:
    goal = sent(yeses=1)
    goal.status(state, 2.0, ours=True)
    assert goal.awaits_result_of is state
    return goal


@dataclass
class Earlier:
    """An earlier goal: an attempt, and the future of its call."""

    goal: Goal
    cancel_is_ours: bool = False
    over: bool = True

    @property
    def goals(self) -> GoalsOfCall:
        return GoalsOfCall([self.goal.facts])

    @property
    def _call(self) -> Earlier:
        return self

    def done(self) -> bool:
        return self.over

    def cancel(self) -> None: ...


SUCCEEDED, ABORTED, CANCELED = GoalState.SUCCEEDED, GoalState.ABORTED, GoalState.CANCELED
FOUND = "runs, its process has died: leftovers look for another goal (`parallel`)"
UNSEEN = "one server's answer has ended it, another has never shown that it has it"
WAYS: dict[str, list[Callable[[], Earlier]]] = {
    "may run, its server is in the graph: silent, too, or restarted as it seems": [
        lambda: Earlier(sent()),
        lambda: Earlier(sent(yeses=1)),
        lambda: Earlier(unknown_so_far()),
        lambda: Earlier(lost()),
        lambda: Earlier(lost(yeses=0)),
        lambda: Earlier(lost(2, away=1)),
        lambda: Earlier(back()),
        lambda: Earlier(ended(ABORTED, 2, 2)),
    ],
    "may run, each server that may run it has left the graph": [
        lambda: Earlier(lost(away=1)),
        lambda: Earlier(lost(yeses=0, away=1)),
        lambda: Earlier(lost(2, 2, away=2)),
    ],
    "may run, and nobody follows it: its client was closed, or let it run": [
        lambda: Earlier(unfollowed(sent(yeses=1))),
        lambda: Earlier(unfollowed(sent())),
        lambda: Earlier(unfollowed(lost(away=1))),
    ],
    UNSEEN: [lambda: Earlier(ended(ABORTED, 2)), lambda: Earlier(rejected(2))],
    "has ended by itself, and its result may still come": [
        lambda: Earlier(seen_to_end(SUCCEEDED)),
        lambda: Earlier(seen_to_end(ABORTED)),
        lambda: Earlier(seen_to_end(CANCELED)),
        lambda: Earlier(seen_to_end(SUCCEEDED), cancel_is_ours=True),
    ],
    "has ended by our cancel, and its result may still come": [
        lambda: Earlier(seen_to_end(CANCELED), cancel_is_ours=True)
    ],
    "does not run any more": [lambda: Earlier(ended(SUCCEEDED)), lambda: Earlier(rejected())],
    "does not run any more, but its call is not over": [
        lambda: Earlier(ended(ABORTED), over=False),
        lambda: Earlier(seen_to_end(ABORTED), over=False),
    ],
    FOUND: [],
}
PAGE = Page(
    "architecture.md", {"another attempt": [*ATTEMPTS], "another goal": [(w,) for w in WAYS]}
)


# --- who asks ----------------------------------------------------------------------------------


def a_call(resend: str) -> Callable[[Any], bool]:
    def may_send(earlier: Any) -> bool:
        machine = CallMachine(uuid.uuid4(), resend, None, None)
        machine.earlier = [earlier]
        return machine.may_send()

    return may_send


def one_that_replaces(earlier: Any) -> bool:
    return not not_stopped((earlier,))


def a_leaf(earlier: Any) -> bool:
    runs = Runs()
    runs.begin(None).future = earlier
    return not runs.before(runs.begin(None))


def a_toolbox(earlier: Any) -> bool:
    goals, record = Goals(), ToolGoal("move", "/move")
    assert goals.add(record, 1)
    record._goals = earlier.goals
    record.value = cast(Any, "told") if earlier.done() else None
    return goals.add(ToolGoal("move", "/move"), 1)


def leftovers(resend: str) -> bool:
    """Whether they look for another goal, by what the call writes down."""
    life, written = CallLife(retry=RetryPolicy(resend=cast(Any, resend))), []
    ledger = SimpleNamespace(_add=lambda *_, **told: written.append(told), _attempt_id=uuid.uuid5)
    life.call.write_down(cast(Any, ledger), 0)
    return bool(written[0]["parallel"])


ASK = [*(a_call(each) for each in POLICIES), one_that_replaces, a_leaf, a_toolbox]
DO_NOT_ASK = {
    # A call goes on only while its client is open, and asks only about its own goals.
    "may run, and nobody follows it: its client was closed, or let it run": POLICIES,
    "does not run any more, but its call is not over": POLICIES,
}


def told(answers: set[bool]) -> str:
    assert len(answers) == 1
    return "yes" if answers.pop() else "no"


def test_the_tables_have_these_rows() -> None:
    PAGE.check()
    assert {news for all_news in ATTEMPTS.values() for news in all_news} == set(LastNews)


def test_whether_there_may_be_another_attempt() -> None:
    seen = {
        row: [
            told({may_try_again(row[0] == "rejected", each, resend) for each in news})
            for resend in POLICIES
        ]
        for row, news in ATTEMPTS.items()
    }
    PAGE.record("another attempt", seen)


@pytest.mark.parametrize("way", WAYS)
def test_whether_another_goal_may_be_sent(way: str) -> None:
    if way == FOUND:
        seen = [*(told({leftovers(each)}) for each in POLICIES), "-", "-", "-"]
    else:
        unasked = len(DO_NOT_ASK.get(way, ()))
        answers = [told({ask(make()) for make in WAYS[way]}) for ask in ASK[unasked:]]
        seen = ["-"] * unasked + answers
    PAGE.record("another goal", {(way,): seen})


def test_what_a_second_server_may_still_accept_is_not_followed_until_it_does() -> None:
    """So it may never be known to be over, and would hold up a leaf for ever."""
    for make in WAYS[UNSEEN]:
        earlier = make()
        assert earlier.goal.stage is Stage.OVER
        assert not earlier.goal.facts.is_over
        again = Goal(earlier.goal.facts.goal_id, Timeouts())
        again.taken_back(earlier.goal.facts, 2, 3.0)
        assert not any(ask(earlier) for ask in (*ASK[:3], *ASK[4:]))

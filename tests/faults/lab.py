"""Goals in every phase and with every policy, which wait for a fault; and their outcomes.

One server follows a script for each goal, and one client sends them, in order. A fault strikes
them all at once, since the slow part of most faults, the lease of the middleware, can be
waited for together. What each call came to is a row of the table in docs/maintainers/faults.md.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from actionkit import Outcome, RetryBudget, RetryPolicy, Timeouts
from actionkit.servers import Server, ServerEvent
from tests.faults.table import Case, Row

POLICIES = {
    "no retries": RetryPolicy.none(),
    "never_accepted": RetryPolicy(resend="never_accepted"),
    "confirmed_stopped": RetryPolicy(),
    "server_gone": RetryPolicy(resend="server_gone"),
    "always": RetryPolicy(resend="always"),
}

#: Long enough for a loaded machine to get all goals going, and short enough for three attempts
#: to come to an end before the lease of about 20 s does.
TIMEOUTS = Timeouts(server=3.0, accept=4.0, cancel=1.0, result=7.0)

BEFORE_ACCEPT = "before accept"
ACCEPTED = "executing, no feedback"
FEEDBACK = "during feedback"
ENDED = "ended, no result yet"
ENDS = "ends during the fault"

DEADLINE = "its deadline passes"
CANCEL = "its caller cancels"
NEVER_END = [*2 * [["accept", {"feedback": 1}, "never"]], [{"feedback": 2}]]

#: A goal that is begun after the fault.
_WORKS = [{"feedback": 2}]

#: What the server does in each phase. At the first gate, or in the midst of feedback, the
#: fault strikes; those that survive it are let through. One that is accepted only then has to
#: be stopped by its client. In the order in which the goals are sent: the time for acceptance
#: is short.
SCRIPTS: dict[str, list[Any]] = {
    ENDED: ["accept", "no_result"],
    ENDS: ["accept", "gate", {"feedback": 2}],
    ACCEPTED: ["accept", "gate", {"feedback": 2}],
    FEEDBACK: ["accept", {"feedback": 30, "period": 0.05}, "gate", {"feedback": 2}],
    BEFORE_ACCEPT: ["gate", "accept", "never"],
}
PHASES = (ENDED, ACCEPTED, FEEDBACK, BEFORE_ACCEPT)

#: Takes longer than the second after which the client reads the status topic: when this goal
#: has ended, the client knows that others have.
_BARRIER = [{"feedback": 13, "period": 0.1}]

_NOTICED = {"LOST", "TIMED_OUT", "RETRYING"}


def budget() -> RetryBudget:
    """One that forbids nothing: here, many calls fail on purpose."""
    return RetryBudget(capacity=10_000)


@dataclass(frozen=True)
class Seen:
    """What a call came to, as its caller saw it; fit for JSON.

    Attributes:
        error: The class of its error, or `""`.
        cancel: The report on its last goal, or `""`.
        attempts: How many goals were sent.
        goals: Their ids.
        events: The states of its timeline, each with its monotonic time and a detail.
        text: Of the error.
    """

    error: str
    cancel: str
    attempts: int
    goals: Sequence[str]
    events: Sequence[Sequence[Any]]
    text: str

    @classmethod
    def of(cls, outcome: Outcome[Any]) -> Seen:
        error = outcome.error
        return cls(
            error="" if error is None else type(error).__name__,
            cancel="" if outcome.cancel is None else str(outcome.cancel),
            attempts=outcome.attempts,
            goals=list(dict.fromkeys(str(event.goal_id) for event in outcome.timeline)),
            events=[(str(e.state), e.monotonic, e.detail) for e in outcome.timeline],
            text=str(error or ""),
        )

    def noticed(self, fault: float) -> float | None:
        """Seconds from the fault until the client knew of it; `None` where it need not."""
        times = (at for state, at, _ in self.events if state in _NOTICED and at >= fault)
        return next((at - fault for at in times), None)

    @property
    def outcome(self) -> str:
        """In a few words, for the table."""
        attempts = f", attempt {self.attempts}" if self.attempts > 1 else ""
        cancel = f", goal {self.cancel}" if self.cancel else ""
        return (f"`{self.error}`" if self.error else "result") + cancel + attempts


class Caller(Protocol):
    """A client, here or in a process elsewhere."""

    def call(self, key: str, policy: str, timeout: float | None = None) -> None:
        """Send a goal that is called `key` from now on."""

    def cancel(self, key: str) -> None:
        """Cancel it, as its caller."""

    def wait_for_feedback(self, key: str) -> None:
        """Until the first has come."""

    def seen(self, key: str, timeout: float) -> Seen:
        """Wait for the end of a call."""

    def close(self) -> bool:
        """Close the client; return whether it goes on watching for goals."""


def scripts(phases: Sequence[str]) -> list[list[Any]]:
    """The option of a scripted server: for each goal of `Lab.fill`, and for those to follow."""
    found = []
    for phase in phases:
        found += [SCRIPTS[phase]] * len(POLICIES)
        if phase == ENDED:
            found.append(_BARRIER)
    return [*found, _WORKS]


class Lab:
    """A server and a caller, with goals in flight in every phase."""

    def __init__(self, server: Server, caller: Caller, phases: Sequence[str] = PHASES) -> None:
        self.server = server
        self.caller = caller
        self.keys = [f"{phase}/{policy}" for phase in phases for policy in POLICIES]
        self._phases = phases
        self._first: dict[str, str] = {}  # key to the id of its first goal

    def fill(self) -> None:
        """Send a goal for each phase and policy; return when all have come to their phase."""
        sent = 0
        for phase in self._phases:
            keys = [key for key in self.keys if key.split("/")[0] == phase]
            for key in keys:
                self.caller.call(key, key.split("/")[1])
            received = self.server.wait_for("goal_received", count=sent + len(keys))[sent:]
            self._first |= {
                key: str(event.goal_id) for key, event in zip(keys, received, strict=True)
            }
            sent += len(keys)
            for key in keys:
                self._see_in_phase(phase, key)
            if phase == ENDED:
                self.caller.call("barrier", "no retries")
                assert self.caller.seen("barrier", 20).error == ""
                sent += 1

    def _see_in_phase(self, phase: str, key: str) -> None:
        goal_id = self._first[key]
        if phase == ENDED:
            self.server.wait_for("succeeded", goal_id=goal_id)
        elif phase == BEFORE_ACCEPT:
            self.server.wait_for("step", goal_id=goal_id)
        else:
            # Asked for once the client knows of the acceptance.
            self.server.wait_for("result_requested", goal_id=goal_id)
            self.server.wait_for("step", goal_id=goal_id, count=2)
        if phase == FEEDBACK:
            self.caller.wait_for_feedback(key)

    def let_end(self, phase: str) -> None:
        """Let the goals of the first phase end, and no other."""
        assert phase == self._phases[0]
        self.server.release(len(POLICIES))
        for key in self.keys[: len(POLICIES)]:
            self.server.wait_for("succeeded", goal_id=self._first[key])

    def see_stopped(self, *phases: str) -> None:
        """Wait until all goals of these phases are cancelled, which nobody has to ask for."""
        for key in self.keys:
            if key.split("/")[0] in phases:
                self.server.wait_for("canceled", goal_id=self._first[key], timeout=30)

    def seen(self, timeout: float = 60) -> dict[str, Seen]:
        """What all calls came to; waits for their ends."""
        return {key: self.caller.seen(key, timeout) for key in self.keys}

    def still_works(self) -> None:
        """The same client, with the server that is there now, needs no help."""
        self.caller.call("afterwards", "confirmed_stopped", 40.0)
        afterwards = self.caller.seen("afterwards", 50)
        assert afterwards.error == "", afterwards.text
        assert self.server.wait_for("succeeded", goal_id=afterwards.goals[-1])

    def close(self, *, watches: bool = False) -> None:
        """End the client, which leaves nothing behind.

        Args:
            watches: Goals were sent that no server has answered for: a closed client goes on
                watching for their acceptance for a while (C2.4).
        """
        assert self.caller.close() == watches

    def rows(self, fault: str, struck: float, seen: dict[str, Seen]) -> Iterator[Row]:
        """A row for each call; checks what holds under every fault."""
        left = settle(self.server)
        events = self.server.events
        for key, one in seen.items():
            phase, policy = key.split("/")
            goals = {self._first[key], *one.goals}
            row = Row(
                case=Case(fault, phase, policy),
                outcome=one.outcome,
                noticed=one.noticed(struck),
                executed=executed(events, goals),
                at_once=at_once(events, goals),
                left=len(goals & left),
            )
            check(row, one)
            yield row


def give_up(
    fault: str, server: Server, caller: Caller, strike: Callable[[], None], heal: Callable[[], None]
) -> Iterator[Row]:
    """Give up on goals of a server that cannot be reached; yields their rows.

    Args:
        fault: What the table calls it.
        server: A scripted one, with the option `NEVER_END`.
        caller: Its client.
        strike: Takes the server out of reach.
        heal: Undoes that.
    """
    caller.call(DEADLINE, "confirmed_stopped", 4.0)
    caller.call(CANCEL, "confirmed_stopped")
    for key in (DEADLINE, CANCEL):
        caller.wait_for_feedback(key)
    struck = time.monotonic()
    strike()
    caller.cancel(CANCEL)
    seen = {key: caller.seen(key, 20) for key in (DEADLINE, CANCEL)}
    heal()
    for one in seen.values():
        assert server.wait_for("canceled", goal_id=one.goals[-1], timeout=30)
    caller.call("afterwards", "confirmed_stopped", 40.0)
    assert caller.seen("afterwards", 50).error == ""
    left, events = settle(server), server.events
    for key, one in seen.items():
        goals = set(one.goals)
        row = Row(
            case=Case(fault, key, "confirmed_stopped"),
            outcome=one.outcome,
            noticed=one.noticed(struck),
            executed=executed(events, goals),
            at_once=at_once(events, goals),
            left=len(goals & left),
        )
        check(row, one)
        yield row


def check(row: Row, seen: Seen) -> None:
    """What no fault may cause, even if the table says so."""
    story = f"{row}\n{seen.text}\n" + "\n".join(map(str, seen.events))
    assert row.left == 0, story
    assert row.executed <= seen.attempts, story
    if row.case.policy != "always":
        assert row.at_once <= 1, story
    if row.case.policy in ("no retries", "never_accepted"):
        assert row.executed <= 1, story


def executed(events: list[ServerEvent], goals: set[str]) -> int:
    """How many times one of the goals began to execute."""
    return sum(event.event == "executing" and event.goal_id in goals for event in events)


def at_once(events: list[ServerEvent], goals: set[str]) -> int:
    """The most of the goals that executed at one time."""
    running: set[tuple[str, Any]] = set()
    most = incarnation = 0
    for event in events:
        if event.incarnation != incarnation:
            incarnation = event.incarnation
            running.clear()  # with their process
        if event.goal_id not in goals:
            continue
        key = (str(event.goal_id), event.details.get("server", 0))
        if event.event == "executing":
            running.add(key)
            most = max(most, len(running))
        elif event.event in ("succeeded", "canceled", "aborted"):
            running.discard(key)
    return most


def settle(server: Server, timeout: float = 20.0) -> set[str]:
    """The goals that go on running on the server, with nobody to stop them."""
    server.sync()
    for goal_id in server.running():
        with contextlib.suppress(AssertionError):
            server.wait_for("canceled", goal_id=goal_id, timeout=timeout)
    return server.running()

"""Whether what callers were told agrees with what the servers' journals show. Pure.

It knows nothing of how ActionKit works: only calls, journals, and what was done to the servers.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field

from actionkit.servers import ServerEvent
from tests.faults.lab import at_once, executed
from tests.soak.records import GRACE, PATIENCE, Record, expected

_SURELY = 0.7
"""Seconds before the end of the grace in which an answer surely has come, on any machine."""
_ENDS = ("succeeded", "canceled", "aborted")
_LOSSES = {"kill", "terminate", "restart"}
#: Errors that only a server or a network can cause that something was done to.
_TRANSIENT = {
    "ServerUnavailableError",
    "ServerLostError",
    "AcceptanceTimeoutError",
    "ResultLostError",
}


@dataclass(frozen=True)
class Problem:
    """Something that is not as promised.

    Attributes:
        what: "wrong", "late", "twice", "hung" or "left".
        text: What was found.
    """

    what: str
    text: str


@dataclass
class Journal:
    """What a server saw in a round, and what was done to it.

    Attributes:
        events: All of its events, over restarts.
        done: What was done to it: "kill", "terminate", "stop", "loss"; "lingers" where the one of
            the round before is dead, and may still be in sight, so that goals are sent to it.
    """

    events: Sequence[ServerEvent]
    done: Collection[str] = ()
    _by_goal: dict[str, list[ServerEvent]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for event in self.events:
            if event.goal_id is not None:
                self._by_goal.setdefault(event.goal_id, []).append(event)

    def of(self, goal_id: str) -> list[ServerEvent]:
        return self._by_goal.get(goal_id, [])

    def ended(self, goal_id: str) -> ServerEvent | None:
        """The event of its end; none where it did not end, or with its process."""
        return next((e for e in reversed(self.of(goal_id)) if e.event in _ENDS), None)

    def of_all(self, goals: Iterable[str]) -> list[ServerEvent]:
        """The events of some goals, in order."""
        found = [event for goal_id in goals for event in self.of(goal_id)]
        return sorted(found, key=lambda event: event.monotonic)

    def story(self, record: Record) -> str:
        """What happened to the goals of a call, in seconds from its beginning."""
        events = " ".join(
            f"{event.monotonic - record.began:.3f} {event.event}"
            for event in self.of_all(set(record.goals))
        )
        times = [f"ended {(record.ended or 0) - record.began:.3f}", f"timeout {record.timeout:.3f}"]
        if record.given_up is not None:
            times.append(
                f"given up {record.given_up - record.began:.3f}, {record.together} at once"
            )
        how = f"{record.error or 'success'} {record.cancel}".rstrip()
        return f"{record.kind}({record.order}): {how}, {', '.join(times)}; server: {events}"

    def served_until(self, when: float) -> float:
        """When it last cancelled a goal before that: for so long it was worth waiting for it."""
        kinds = ("cancel_accepted", "canceled")
        times = [e.monotonic for e in self.events if e.event in kinds and e.monotonic <= when]
        return max(times, default=0.0)

    @property
    def healthy(self) -> bool:
        return not self.done

    @property
    def may_miss_an_end(self) -> bool:
        """Whether its process may have died between a goal's end and the journal's line."""
        return bool(_LOSSES.intersection(self.done))


def judge(record: Record, journal: Journal) -> list[Problem]:
    """What is wrong with one call."""
    text = f"{record.kind}({record.order}) {record.goals}: {record.error or 'success'}"
    if record.ended is None:
        return [Problem("hung", f"{text}: it did not end")]
    found = [Problem("wrong", f"{text}: {wrong}") for wrong in _wrong(record, journal)]
    events = journal.of_all(set(record.goals))
    if record.policy != "always" and at_once(events, set(record.goals)) > 1:
        found.append(Problem("twice", f"{text}: two of its goals ran at one time"))
    if executed(events, set(record.goals)) > len(set(record.goals)):
        found.append(Problem("twice", f"{text}: one of its goals ran twice"))
    return found


def _wrong(record: Record, journal: Journal) -> Iterable[str]:
    last = record.goals[-1] if record.goals else ""
    end = journal.ended(last)
    how = end.event if end is not None else "not ended"
    if not record.error:
        yield from _success(record, journal)
    elif record.late is not None and list(record.late) != expected(record.kind, record.order):
        yield f"late_result is {record.late}"
    if record.cancel == "CONFIRMED" and end is None and not journal.may_miss_an_end:
        yield "CONFIRMED, and it has not ended"
    yield from _kept_back(record, journal, end)
    if record.error == "GoalAbortedError" and how != "aborted" and not journal.may_miss_an_end:
        yield f"it was {how}"
    if record.error == "GoalRejectedError" and not any(
        event.event == "rejected" for event in journal.of(last)
    ):
        yield "it was not rejected"
    if record.error == "GoalCanceledError":
        yield "nobody else cancels goals here"
    # A server that a client has not discovered when its deadline passes is none.
    undiscovered = record.error == "ServerUnavailableError" and record.timeout < PATIENCE
    if record.error in _TRANSIENT and journal.healthy and not undiscovered:
        yield f"nothing was done to its server: {record.text} {journal.story(record)}"
    if record.error == "ResultLostError" and not journal.may_miss_an_end:
        yield f"its server was there all the time: {record.text} {journal.story(record)}"
    if record.error == "ServerUnavailableError" and journal.of_all(set(record.goals)):
        yield f"something was sent: {record.text} {journal.story(record)}"
    if record.error not in _KNOWN:
        yield record.text
    if record.error == "DeadlineExceededError" and record.given_up is None:
        early = record.began + record.timeout - (record.ended or 0)
        if early > 0.05:
            yield f"{early:.2f} s before its deadline"
        if record.timeout >= PATIENCE and journal.healthy:
            yield f"it had {record.timeout} s: {record.text}"


def _success(record: Record, journal: Journal) -> Iterable[str]:
    if record.judge == "failure":
        yield "its judge calls it a failure"
    if list(record.result or ()) != expected(record.kind, record.order):
        yield f"its result is {record.result}"
    ends = [journal.ended(goal) for goal in record.goals]
    if not any(end and end.event == "succeeded" for end in ends) and not journal.may_miss_an_end:
        yield "no goal of it succeeded"


def _kept_back(record: Record, journal: Journal, end: ServerEvent | None) -> Iterable[str]:
    """A success that came in time, and was not told of."""
    if record.error != "DeadlineExceededError" or record.late is not None or not journal.healthy:
        return
    if end is None or end.event != "succeeded":
        return
    over = record.began + record.timeout
    if record.given_up is not None:
        over = min(over, record.given_up)
    if end.monotonic < over + GRACE - _SURELY:
        yield f"{record.cancel}: it succeeded {end.monotonic - over:.3f} s after it was given up on"


_KNOWN = _TRANSIENT | {
    "",
    "CancelledError",
    "ClientClosedError",
    "DeadlineExceededError",
    "GoalAbortedError",
    "GoalCanceledError",
    "GoalRejectedError",
    "PermanentError",
    "RetriesExhaustedError",
    "ClassifyError",
}

"""Checks that the callers' outcomes agree with the servers' journals. Pure.

It knows nothing of how ActionKit works: only calls, journals, and what was done to the servers.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field, replace

from actionkit.servers import ServerEvent
from tests.soak.records import GRACE, PATIENCE, Record, expected

_SURELY = 0.7
"""Seconds before the end of the grace in which an answer surely has come, on any machine."""
_ENDS = ("succeeded", "canceled", "aborted")
_LOSSES = {"kill", "terminate", "restart", "vanish"}
_SEVERAL = {"duplicate", "twin", "linger"}
"""What has two servers take the same request, which no client can prevent."""
GONE, HIDDEN, SHOWN = "gone", "hidden", "shown"
"""What is noted beside a server's own events: its process is ended; it is out of sight, and its
goals may run on; it is seen again."""
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
        events: All of its events, over restarts; of all servers of its name, as `merged`.
        done: What was done to it, as a fault is called; "terminate", "loss"; "blocks" where it is
            one that does not answer at once; "lingers" where the one of the round before is dead,
            and may still be in sight, so that goals are sent to it.
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

    def ends(self, goal_id: str) -> dict[str, ServerEvent]:
        """How it ended, on each server that had it; nothing where it ended with its process."""
        return {event.event: event for event in self.of(goal_id) if event.event in _ENDS}

    def at_once(self, goals: Collection[str], seen_since: float | None = None) -> int:
        """The most of the goals that executed at one time.

        Args:
            goals: Their ids. One that two servers execute counts once.
            seen_since: Leave out what executes on a server that is out of sight then, or later.
        """
        running: dict[int, set[str]] = {}
        out: set[int] = set()
        most = 0
        for event in self.events:
            server = event.details.get("process", 0)
            here = running.setdefault(server, set())
            if event.event == GONE or (event.event == HIDDEN and seen_since is not None):
                out.add(server)
                here.clear()
            elif event.event == "ready":  # one that was not told to end may have started again
                out.discard(server)
                here.clear()
            elif event.event == SHOWN and event.monotonic < (seen_since or 0.0):
                out.discard(server)
            elif event.goal_id in goals and event.event in _ENDS:
                here.discard(event.goal_id)
            elif event.goal_id in goals and event.event == "executing" and server not in out:
                here.add(event.goal_id)
                most = max(most, len(set().union(*running.values())))
        return most

    def ran_twice(self, goals: Collection[str]) -> bool:
        """Whether a server executed one of the goals twice, or several did without need."""
        runs = Counter(
            (event.goal_id, event.details.get("process", 0))
            for event in self.of_all(goals)
            if event.event == "executing"
        )
        several = len({goal for goal, _ in runs}) < len(runs)
        return max(runs.values(), default=0) > 1 or (several and not _SEVERAL & {*self.done})

    def of_all(self, goals: Iterable[str]) -> list[ServerEvent]:
        """The events of some goals, in order."""
        found = [event for goal_id in goals for event in self.of(goal_id)]
        return sorted(found, key=lambda event: event.monotonic)

    def story(self, record: Record) -> str:
        """What happened to the goals of a call, in seconds from its beginning."""
        numbers = {goal: number for number, goal in enumerate(record.goals, 1)}
        events = " ".join(
            f"{event.monotonic - record.began:.3f} {event.event}"
            f"({numbers.get(event.goal_id or '', '-')}@{event.details.get('process', 0)})"
            for event in self.events
            if event.goal_id in numbers or event.event in (GONE, HIDDEN, SHOWN)
        )
        times = [f"ended {(record.ended or 0) - record.began:.3f}", f"timeout {record.timeout:.3f}"]
        if record.given_up is not None:
            times.append(
                f"given up {record.given_up - record.began:.3f}, {record.together} at once"
            )
        how = f"{record.error or 'success'} {record.cancel}".rstrip()
        return f"{record.kind}({record.order}): {how}, {', '.join(times)}; goal@server: {events}"

    def served_until(self, when: float) -> float:
        """When it last cancelled a goal before that: for so long it was worth waiting for it."""
        kinds = ("cancel_accepted", "canceled")
        times = [e.monotonic for e in self.events if e.event in kinds and e.monotonic <= when]
        return max(times, default=0.0)

    @property
    def healthy(self) -> bool:
        return not self.done

    @property
    def struck(self) -> bool:
        """Whether anything was done to it: it may have been lost, or out of sight."""
        return bool({*self.done} - {"blocks"})

    @property
    def may_miss_an_end(self) -> bool:
        """Whether its process may have died between a goal's end and the journal's line."""
        return bool(_LOSSES.intersection(self.done))


def merged(servers: Iterable[Iterable[ServerEvent]]) -> list[ServerEvent]:
    """The events of several servers on one name, in order; `process` tells them apart."""
    found = [
        replace(event, details={**event.details, "process": number})
        for number, events in enumerate(servers)
        for event in events
    ]
    return sorted(found, key=lambda event: event.monotonic)


def named(text: str) -> set[str]:
    """The goals of which a text says that they may still be running."""
    lines = [line for line in text.splitlines() if "STILL" in line]
    return {
        goal for line in lines for goal in re.findall(r"[0-9a-f]{8}(?:-[0-9a-f]{4,12}){4}", line)
    }


def told_by(record: Record) -> set[str]:
    """The goals of a call of which its caller knows that they may still be running.

    Where a later attempt succeeds, there is no error to name them, but the outcome says so.
    """
    not_known = not record.error and record.cancel in ("UNKNOWN", "REFUSED")
    return set(record.goals) if not_known else named(record.text)


def excused(
    goals: Collection[str], records: Collection[Record], said: str, out_of_reach: Collection[str]
) -> set[str]:
    """Which of the goals that were left running may be.

    Somebody was told of them, and nobody is there who could cancel them.

    Args:
        goals: Their ids.
        records: The calls.
        said: The log of the process that made them.
        out_of_reach: What runs on servers that nobody can reach any more.
    """
    told = named(said).union(*map(told_by, records))
    watched = {goal for record in records if not record.closed for goal in record.goals}
    return {
        goal for goal in goals if goal in told and (goal in out_of_reach or goal not in watched)
    }


def judge(record: Record, journal: Journal) -> list[Problem]:
    """What is wrong with one call."""
    text = f"{record.kind}({record.order}) {record.goals}: {record.error or 'success'}"
    if record.ended is None:
        return [Problem("hung", f"{text}: it did not end")]
    found = [Problem("wrong", f"{text}: {wrong}") for wrong in _wrong(record, journal)]
    goals = set(record.goals)
    seen_since = record.began if record.policy == "server_gone" else None
    if record.policy != "always" and journal.at_once(goals, seen_since) > 1:
        text = f"{text}: two of its goals ran at one time, {record.policy}"
        found.append(Problem("twice", f"{text}: {journal.story(record)}"))
    if journal.ran_twice(goals):
        text = f"{text}: one of its goals ran twice: {journal.story(record)}"
        found.append(Problem("twice", text))
    return found


def _wrong(record: Record, journal: Journal) -> Iterable[str]:
    last = record.goals[-1] if record.goals else ""
    ends = journal.ends(last)
    how = " and ".join(ends) or "not ended"
    if not record.error:
        yield from _success(record, journal)
    elif record.late is not None and list(record.late) != expected(record.kind, record.order):
        yield f"late_result is {record.late}"
    if record.cancel == "CONFIRMED" and not ends and not journal.may_miss_an_end:
        yield "CONFIRMED, and it has not ended"
    yield from _kept_back(record, journal, ends.get("succeeded"))
    if record.error == "GoalAbortedError" and "aborted" not in ends and not journal.may_miss_an_end:
        yield f"it was {how}"
    if record.error == "GoalRejectedError" and not any(
        event.event == "rejected" for event in journal.of(last)
    ):
        yield "it was not rejected"
    if record.error == "GoalCanceledError":
        yield f"nobody else cancels goals here: {record.text} {journal.story(record)}"
    # A server that a client has not discovered when its deadline passes is none.
    undiscovered = record.error == "ServerUnavailableError" and record.timeout < PATIENCE
    unanswered = record.error == "AcceptanceTimeoutError" and "blocks" in journal.done
    if record.error in _TRANSIENT and not journal.struck and not (undiscovered or unanswered):
        yield f"nothing was done to its server: {record.text} {journal.story(record)}"
    guess = "linger" in journal.done and "it was restarted, or started twice" in record.text
    if record.error == "ResultLostError" and not (journal.may_miss_an_end or guess):
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
    succeeded = any("succeeded" in journal.ends(goal) for goal in record.goals)
    if not succeeded and not journal.may_miss_an_end:
        yield "no goal of it succeeded"


def _kept_back(record: Record, journal: Journal, end: ServerEvent | None) -> Iterable[str]:
    """A success that came in time, and was not told of."""
    if record.error != "DeadlineExceededError" or record.late is not None or not journal.healthy:
        return
    if end is None:
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

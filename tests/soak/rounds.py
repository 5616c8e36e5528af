"""One round of the soak: servers, calls, faults and programs; and what is wrong after it."""

from __future__ import annotations

import concurrent.futures
import queue
import time
from collections import Counter
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tests.conftest import NEVER
from tests.faults.crowd import endings, untold, untrue
from tests.soak import records
from tests.soak.oracle import Journal, Problem, excused, judge
from tests.soak.place import Place
from tests.soak.plan import Plan
from tests.soak.processes import Ended, Worker, run_program
from tests.soak.records import KINDS, Record
from tests.soak.serving import Serving

_CALLS_END = 90.0
"""Seconds after the end of a round's calls in which the last of them has ended."""
_DRAIN = 40.0
"""Seconds in which goals that were given up on end: a closed client watches them for 30 s."""
_LATE = 3.0
"""Seconds beyond a call's bound that a busy machine may make of it."""


@dataclass
class Result:
    """What a round came to.

    Attributes:
        plan: What was done.
        place: Where.
        outcomes: How many calls ended how.
        problems: What was not as promised.
        late: The longest delay beyond a call's bound, in seconds.
        state: What must not grow, of the worker; empty where it was hung.
        programs: How many were told to end.
        unconfirmed: Calls given up on with servers in good health, and not confirmed in time.
        told: How many goals were left running, but named, and out of reach.
    """

    plan: Plan
    place: str
    outcomes: Counter[str] = field(default_factory=Counter)
    problems: list[Problem] = field(default_factory=list)
    late: float = 0.0
    state: dict[str, Any] = field(default_factory=dict)
    programs: int = 0
    unconfirmed: int = 0
    told: int = 0


class Round:
    """The servers of a round, and what is done to them."""

    def __init__(self, place: Place, worker: Worker, plan: Plan, directory: Path) -> None:
        self._place = place
        self._worker = worker
        self._plan = plan
        self._directory = directory
        self._servers: dict[str, Serving] = {}
        self.result = Result(plan, place.name)

    def run(self) -> Result:
        """Do it. Where the worker hangs, the result says so, and it is of no more use."""
        self._place.enter()
        with ExitStack() as stack:
            with concurrent.futures.ThreadPoolExecutor(3) as pool:
                started = {kind: pool.submit(Serving, self._place, kind) for kind in KINDS}
            for kind, future in started.items():
                self._servers[kind] = future.result()
                stack.callback(self._servers[kind].stop)
            self._run(self._directory / "records.jsonl")
        # A process that was killed, or lost its last message, is in sight for 20 s more.
        self._place.lingering = frozenset(
            kind for kind in KINDS if self._done(kind) & {"kill", "loss"}
        )
        return self.result

    def _run(self, path: Path) -> None:
        plan = self._plan
        began = time.monotonic()
        if not self._worker.tell(seconds=plan.seconds, seed=plan.seed, records=str(path)):
            self._found("hung", f"the process that calls is gone:\n{self._worker.stacks()}")
            return
        with concurrent.futures.ThreadPoolExecutor(1 + len(plan.programs)) as pool:
            faults = pool.submit(self._strike, began)
            programs = [pool.submit(self._program, one, began) for one in plan.programs]
            hung = False
            try:
                self._worker.answer(plan.seconds + _CALLS_END)
            except queue.Empty:
                hung = True
                self._found("hung", f"calls did not end:\n{self._worker.stacks()}")
            faults.result()
            ended = [program.result() for program in programs]
        left = self._drain()
        # The journals are whole only now.
        journals = {
            kind: Journal(serving.events, self._done(kind))
            for kind, serving in self._servers.items()
        }
        found = records.read(path) if path.exists() else []
        self._judge(found, journals)
        self._judge_programs(ended)
        self._judge_left(left, found, journals, ended)
        if not hung:
            self._worker.tell(state=True)
            self.result.state = self._worker.answer(60)

    # -- what is done ------------------------------------------------------------------------

    def _strike(self, began: float) -> None:
        plan = self._plan
        if plan.loss and self._place.cable is not None:
            self._place.cable.lose(plan.loss)
        for fault in plan.faults:
            _wait_until(began + fault.at)
            self._servers[fault.kind].strike(fault)
        _wait_until(began + plan.seconds)
        if plan.loss and self._place.cable is not None:
            self._place.cable.lose_nothing()

    def _program(self, one: Any, began: float) -> Ended:
        _wait_until(began + one.at)
        return run_program(self._place, one, self._directory)

    def _drain(self) -> dict[str, set[str]]:
        """The goals that go on running on each server though nobody waits for them."""
        until = time.monotonic() + _DRAIN
        return {kind: serving.drain(until) for kind, serving in self._servers.items()}

    # -- what came of it -----------------------------------------------------------------------

    def _found(self, what: str, text: str) -> None:
        self.result.problems.append(Problem(what, text))

    def _done(self, kind: str) -> set[str]:
        done = self._servers[kind].done
        done |= {"lingers"} if kind in self._place.lingering else set()
        return done | ({"loss"} if self._plan.loss else set())

    def _judge(self, found: list[Record], journals: dict[str, Journal]) -> None:
        for record in found:
            journal = journals[record.kind]
            self.result.problems += judge(record, journal)
            cancel = f" {record.cancel}" if record.cancel else ""
            self.result.outcomes[(record.error or "success") + cancel] += 1
            if record.ended is None:
                continue
            served = 0.0 if journal.healthy else journal.served_until(record.ended)
            late = record.ended - record.bound(healthy=journal.healthy, served_until=served)
            self.result.late = max(self.result.late, late)
            if late > _LATE:
                self._found("late", f"{late:.1f} s beyond its bound: {journal.story(record)}")
            if journal.healthy and record.cancel == "UNKNOWN":
                self.result.unconfirmed += 1

    def _judge_programs(self, programs: list[Ended]) -> None:
        self.result.programs = len(programs)
        for ended in programs:
            if ended.problem:
                self._found("hung", f"{ended.program}: {ended.problem}")
            if ended.crowd is not None and ended.report and not self._done("endless"):
                mistaken = untrue(ended.crowd, endings(self._servers["endless"].first))
                unknown = sum(end.cancel == "UNKNOWN" for end in ended.crowd.ends)
                self.result.unconfirmed += unknown
                if mistaken:
                    text = f"{len(mistaken)} outcomes of {ended.program}: {mistaken[:3]}"
                    self._found("wrong", text)

    def _judge_left(
        self,
        left: dict[str, set[str]],
        found: list[Record],
        journals: dict[str, Journal],
        programs: list[Ended],
    ) -> None:
        said = self._worker.said()
        owners = {goal: record for record in found for goal in record.goals}
        for kind, goals in left.items():
            texts = {}
            for goal in sorted(
                goals - excused(goals, found, said, self._servers[kind].out_of_reach)
            ):
                events = [f"{e.event}@{e.details['process']}" for e in journals[kind].of(goal)]
                owner = owners.get(goal)
                story = f"{owner.text} {journals[kind].story(owner)}" if owner else "of a program"
                texts[goal] = f"{kind} {goal}: {events}; {story}"
            number = len(texts)
            if kind == "endless":
                number -= sum(number - untold({*texts}, ended.err) for ended in programs)
            for text in [*texts.values()][: max(0, number)]:
                self._found("left", text)
            self.result.told += len(goals) - max(0, number)


def _wait_until(when: float) -> None:
    NEVER.wait(max(0.0, when - time.monotonic()))

"""The calls of the soak, and the record of each call. No rclpy here."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from actionkit._model.settings import LONGEST_GRACE

GRACE = 2.0
"""`Timeouts.cancel` of all clients of the soak, in seconds."""
_AT_ONCE = 8
"""Goals that are cancelled at the same time; the others wait for their turn."""
_LOST_COMES = 3.5
"""Seconds until what was lost on the network is there, with Fast DDS."""
PATIENCE = 30.0
"""The deadline of calls that are to come to an end by themselves, in seconds."""


@dataclass(frozen=True)
class Kind:
    """A server, and which goals it gets.

    Attributes:
        server: Its name among the reference servers.
        options: Its options.
        orders: The smallest and the largest order of a goal.
        ends: Whether its goals end by themselves.
        answers: Whether it answers at once; fewer calls are made of one that does not.
        accept: `Timeouts.accept` of its clients, in seconds.
    """

    server: str
    options: dict[str, Any] = field(default_factory=dict)
    orders: tuple[int, int] = (1, 15)
    ends: bool = True
    answers: bool = True
    accept: float = 10.0


#: By the name of the action.
KINDS = {
    "steady": Kind("fibonacci", {"period": 0.02}),
    "endless": Kind("never_finishes", ends=False),
    "stubborn": Kind("refuses_cancel", {"period": 0.03}),
    "picky": Kind("guarded", {"period": 0.02}),
    "aborting": Kind("aborts", {"period": 0.02}),
    "flaky": Kind("flaky", {"period": 0.02, "fails": 5}),
    "slow": Kind("slow_accept", {"period": 0.02, "delay": 0.3}),
    # Their clients give up before they answer; what the second accepts then goes on for a minute.
    "blocked": Kind("blocking", {"delay": 2.0}, answers=False, accept=1.0),
    "deaf": Kind("slow_accept", {"period": 1.0, "delay": 2.5}, (60, 90), False, False, accept=0.2),
}


@dataclass
class Record:
    """One call, as its caller saw it. Times are in seconds on the monotonic clock.

    Attributes:
        kind: Which server was called.
        order: Of the goal.
        began: When it was made.
        timeout: Its deadline, in seconds from then.
        policy: The `resend=` of its retries, or "no retries".
        judge: What its `classify=` makes of it: "failure", "aborted" (is tried again) or "".
        given_up: When its caller cancelled it, closed the client, or cancelled the task.
        together: With how many others it was given up on.
        closed: Whether its client was closed then: others have their goals cancelled later, too.
        ended: When it ended; `None`: it did not.
        error: The class of its error, or "".
        cancel: What its outcome says of the goal that was given up on, or "".
        goals: The ids of its goals, in order.
        result: The sequence of its result where it succeeded.
        late: The sequence of its error's `late_result`.
        text: Of the error.
    """

    kind: str
    order: int
    began: float
    timeout: float
    policy: str = "no retries"
    judge: str = ""
    given_up: float | None = None
    together: int = 1
    closed: bool = False
    ended: float | None = None
    error: str = ""
    cancel: str = ""
    goals: Sequence[str] = ()
    result: Sequence[int] | None = None
    late: Sequence[int] | None = None
    text: str = ""

    def bound(self, *, healthy: bool, served_until: float = 0.0) -> float:
        """When it has to have ended, as promised.

        Args:
            healthy: Whether nothing was done to its server, or to the network.
            served_until: When a server that packets to and from were lost on the way of last
                cancelled a goal before this call ended.
        """
        bound = self.began + self.timeout + GRACE
        if self.given_up is not None and self.kind != "stubborn":
            # Confirmations that go on coming lengthen the wait for the others. What is lost on the
            # network comes three seconds later, so that of many they come in waves.
            longer = 0.03 * self.together
            if not healthy:
                longer += 2.0 if self.together <= _AT_ONCE else 10.0
            heard = min(served_until + _LOST_COMES, self.given_up + LONGEST_GRACE)
            bound = min(bound, max(self.given_up + longer, heard) + GRACE)
        return bound


def expected(kind: str, order: int) -> list[int]:
    """The result of a goal that succeeds."""
    if kind == "stubborn":
        return [0]
    if kind == "blocked":
        return [0, 1]
    sequence = [0, 1]
    for _ in range(1, order):
        sequence.append(sequence[-1] + sequence[-2])
    return sequence


def write(path: Path, records: Iterable[Record]) -> None:
    """Write them, a line of JSON each."""
    path.write_text("".join(json.dumps(asdict(record)) + "\n" for record in records))


def read(path: Path) -> list[Record]:
    """Read what was written."""
    return [Record(**json.loads(line)) for line in path.read_text().splitlines()]

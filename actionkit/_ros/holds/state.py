"""What is known of the holds in a ROS domain, and how what others know is added. Pure.

A process that takes part tells all that it knows, and adds what it is told. Adding gives the same
in any order and however often, so it does not matter which process is told first, which was away,
or which clock was set: no time is compared with another here. A hold ends only by its name: a
release names those that it ends, and cannot end one that it does not know of.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

VERSION = 1
MOST_HOLDS = 100
"""Holds that are kept. There is one for each human who holds."""
MOST_RELEASED = 100
"""Ended holds that are remembered, so that a process that was away does not bring them back. Those
that were released first are forgotten first; a process that still had one would hold it again,
until the next release."""
LONGEST = 100_000
"""Characters of a message or a file; all that may be kept is about 20,000."""
_LONGEST_WORD = 300
_LARGEST_RANK = 10**15


@dataclass(frozen=True, order=True)
class Hold:
    """One human's stop.

    Attributes:
        since: When, in seconds since the epoch by the clock of the computer where it was asked for.
            For people only.
        hold_id: Its name; no two have the same.
        by: Who, as `user@host`.
    """

    since: float
    hold_id: str
    by: str


@dataclass(frozen=True)
class HoldState:
    """Holds by their names, and the names of those that were released, each with its rank."""

    holds: Mapping[str, Hold] = field(default_factory=dict)
    released: Mapping[str, int] = field(default_factory=dict)

    @property
    def active(self) -> tuple[Hold, ...]:
        """The holds that nobody has released, the oldest first."""
        return tuple(sorted(self.holds.values()))

    def __bool__(self) -> bool:
        """Whether there is anything to tell."""
        return bool(self.holds or self.released)


def merged(*states: HoldState) -> HoldState:
    """Return all that these states tell together."""
    released: dict[str, int] = {}
    holds: dict[str, Hold] = {}
    for state in states:
        for hold_id, rank in state.released.items():
            released[hold_id] = max(rank, released.get(hold_id, 0))
        for hold_id, hold in state.holds.items():
            # Should two differ under one name, everybody has to take the same.
            holds[hold_id] = min(hold, holds.get(hold_id, hold))
    left = sorted(hold_id for hold_id in holds if hold_id not in released)[:MOST_HOLDS]
    # The highest ranks of a union are among the highest of its parts: so forgetting, too, gives the
    # same in any order.
    kept = sorted(released, key=lambda hold_id: (-released[hold_id], hold_id))[:MOST_RELEASED]
    return HoldState(
        {hold_id: holds[hold_id] for hold_id in left},
        {hold_id: released[hold_id] for hold_id in kept},
    )


def released(state: HoldState, holds: Iterable[Hold]) -> HoldState:
    """Return the state in which these holds have ended."""
    rank = min(_LARGEST_RANK, 1 + max(state.released.values(), default=0))
    return merged(state, HoldState({}, {hold.hold_id: rank for hold in holds}))


def older_of_same(state: HoldState, own: Hold) -> tuple[Hold, ...]:
    """Return the holds of the same human that `own` replaces.

    Of two, each with a keeper, only one is an older one of the other; so they never end each other,
    even if their clocks differ.
    """
    return tuple(hold for hold in state.active if hold.by == own.by and hold < own)


@dataclass(frozen=True)
class Sender:
    """A process that takes part.

    Attributes:
        node: The name of its node, which no other process has.
        role: Such as `"agent"` or `"keeper"`.
        by: The owner of the process, as `user@host`.
        pid: Its number there.
    """

    node: str
    role: str
    by: str
    pid: int

    def __str__(self) -> str:
        return f"{self.role} of {self.by} (process {self.pid})"


def encode(state: HoldState, sender: Sender | None = None) -> str:
    """Return the state as a line of JSON."""
    told: dict[str, Any] = {
        "actionkit_hold": VERSION,
        "holds": [[hold.hold_id, hold.by, hold.since] for hold in state.active],
        "released": dict(state.released),
    }
    if sender is not None:
        told["from"] = [sender.node, sender.role, sender.by, sender.pid]
    return json.dumps(told, separators=(",", ":"))


def decode(text: str) -> tuple[HoldState, Sender | None]:
    """Return what `encode` wrote.

    What cannot be read counts as a hold of its own: it may be one that a later version tells of.
    A release ends it as any other.
    """
    try:
        if len(text) > LONGEST:
            raise ValueError("too long")
        told = json.loads(text)
        if told["actionkit_hold"] != VERSION:
            raise ValueError("another version")
        holds = [_hold(*entry) for entry in told["holds"]]
        ranks = {_word(hold_id): _rank(rank) for hold_id, rank in told["released"].items()}
        sender = _sender(*told["from"]) if "from" in told else None
        state = HoldState({hold.hold_id: hold for hold in holds}, ranks)
        return merged(state), sender
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
        name = hashlib.sha256(text.encode(errors="surrogatepass")).hexdigest()[:16]
        hold = Hold(0.0, f"unreadable-{name}", UNREADABLE)
        return HoldState({hold.hold_id: hold}), None


UNREADABLE = "somebody whose message cannot be read"
"""Takes the place of the name, where it is not known who holds."""


def _hold(hold_id: Any, by: Any, since: Any) -> Hold:
    if isinstance(since, bool) or not isinstance(since, (int, float)) or not 0 <= since < 1e11:
        raise ValueError("no time")
    return Hold(float(since), _word(hold_id), _word(by))


def _sender(node: Any, role: Any, by: Any, pid: Any) -> Sender:
    return Sender(_word(node), _word(role), _word(by), _rank(pid))


def _word(value: Any) -> str:
    if not isinstance(value, str) or not 0 < len(value) <= _LONGEST_WORD:
        raise ValueError("no name")
    return value


def _rank(value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 0 < value <= _LARGEST_RANK:
        raise ValueError("no number")
    return value

"""The state of the holds in a ROS domain, and how the states of several processes are merged. Pure.

Each process publishes everything that it knows, and merges what it receives. Merging gives the same
result in any order and any number of times. So it does not matter which process was first, which
was away, or which clock was set: no times are compared here. A release lists the ids of the holds
that it ends, so it cannot end a hold that it does not know.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

VERSION = 1
MOST_HOLDS = 100
"""Holds that are kept. Each human who holds has one."""
MOST_RELEASED = 100
"""Released holds that are remembered, so that a process that was away does not bring them back. The
oldest are forgotten first. If a process still had one of those, it would be a hold again until the
next release."""
LONGEST = 100_000
"""Characters of a message or a file; the largest state has about 20,000."""
_LONGEST_WORD = 300
_LARGEST_RANK = 10**15


@dataclass(frozen=True, order=True)
class Hold:
    """One human's stop."""

    since: float  # seconds since the epoch, by the clock of the human's computer; only for people
    hold_id: str  # unique
    by: str  # `user@host`


@dataclass(frozen=True)
class HoldState:
    """Holds by id, and the ids of released holds, each with its rank."""

    holds: Mapping[str, Hold] = field(default_factory=dict)
    released: Mapping[str, int] = field(default_factory=dict)

    @property
    def active(self) -> tuple[Hold, ...]:
        """The holds that nobody has released, the oldest first."""
        return tuple(sorted(self.holds.values()))

    def __bool__(self) -> bool:
        """Whether it has any hold or release."""
        return bool(self.holds or self.released)


def merged(*states: HoldState) -> HoldState:
    """Return the union of these states."""
    released: dict[str, int] = {}
    holds: dict[str, Hold] = {}
    for state in states:
        for hold_id, rank in state.released.items():
            released[hold_id] = max(rank, released.get(hold_id, 0))
        for hold_id, hold in state.holds.items():
            # If two holds have the same id, every process must choose the same one.
            holds[hold_id] = min(hold, holds.get(hold_id, hold))
    left = sorted(hold_id for hold_id in holds if hold_id not in released)[:MOST_HOLDS]
    # The highest ranks of a union are among the highest ranks of its parts. So the order does not
    # matter for forgetting, either.
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

    Of two holds that have a keeper each, only one counts as older. So they never end each other,
    even if their clocks differ.
    """
    return tuple(hold for hold in state.active if hold.by == own.by and hold < own)


@dataclass(frozen=True)
class Sender:
    """A process that takes part."""

    node: str  # the name of its node, which no other process has
    role: str  # such as `"agent"` or `"keeper"`
    by: str  # the owner of the process, as `user@host`
    pid: int  # its number there

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

    A text that cannot be read counts as a hold, because a later version may have written it. A
    release ends it like any other.
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
"""Used as the name if it is not known who holds."""


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

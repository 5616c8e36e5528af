"""Reads serialised status and feedback messages without decoding them.

A status message has every goal of the server's last 15 minutes (R24), and rclpy would turn each
into Python objects. The feedback topic has the feedback of all clients' goals. Both are always
serialised in the same way: CDR with a 4-byte header, and a goal id as 16 plain bytes.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from struct import Struct

from actionkit._model.values import GoalState

STATES = {
    1: GoalState.ACCEPTED,
    2: GoalState.EXECUTING,
    3: GoalState.CANCELING,
    4: GoalState.SUCCEEDED,
    5: GoalState.CANCELED,
    6: GoalState.ABORTED,
}
"""Code -> state, of `action_msgs/msg/GoalStatus`. Without 0: the server does not know the goal."""
ID_SIZE = 16
"""Bytes of a goal id, a `uint8[16]`."""
_HEADER = 4
"""Bytes of the CDR header."""
_LENGTH = 4
"""Bytes of the number of status entries, before the first entry."""
_STAMP = 8
"""Bytes of a `builtin_interfaces/Time`: two 32-bit numbers."""
_ENTRY = Struct("<16s3xiIB")
"""A status entry after the first: id, a gap, stamp and status; the first has no gap."""
_FEW = 64
"""Up to this many ids, a search for each is faster than a loop over all entries (measured)."""


def feedback_goal_id(message: bytes) -> bytes:
    """Return the goal id of a serialised feedback message; fewer bytes if it is cut off."""
    return message[_HEADER : _HEADER + ID_SIZE]


def feedback_alone(message: bytes) -> bytes:
    """Return a serialised feedback message without its goal id: a serialised `Feedback`.

    Decoding the id takes longer than decoding a short feedback. The data after the id stays
    aligned, because CDR aligns to 8 bytes at most and the id has 16.
    """
    return message[:_HEADER] + message[_HEADER + ID_SIZE :]


def goals(message: bytes) -> Iterator[tuple[bytes, int, int, int]]:
    """Yield each goal in a serialised status array: its id, the stamp's two numbers, the status.

    `message` is as for `goal_states`.
    """
    message = bytes(message)
    first_stamp = _HEADER + _LENGTH + ID_SIZE
    body = message[_HEADER + _LENGTH : first_stamp] + bytes(3) + message[first_stamp:]
    return _ENTRY.iter_unpack(body[: len(body) // _ENTRY.size * _ENTRY.size])


def goal_states(message: bytes, wanted: Collection[bytes]) -> Iterator[tuple[bytes, int]]:
    """Yield the id and the status code of each wanted goal in a serialised status array.

    `message` is a serialised `action_msgs/msg/GoalStatusArray`. It never raises; an entry that is
    cut off is ignored.
    """
    message = bytes(message)
    if len(wanted) <= _FEW:
        for goal_id in wanted:
            at = message.find(goal_id, _HEADER + _LENGTH)
            if at >= 0 and (status := _status_at(at)) < len(message):
                yield goal_id, message[status]
        return
    yield from ((goal_id, code) for goal_id, _, _, code in goals(message) if goal_id in wanted)


def count_goals(message: bytes, codes: Collection[int]) -> int:
    """Return how many goals in a serialised status array have one of these status codes.

    `message` is as for `goal_states`.
    """
    return sum(code in codes for _, _, _, code in goals(message))


def _status_at(at: int) -> int:
    """Return the offset of the status byte of an entry; `at` is the offset of its id."""
    stamp = -(-(at - _HEADER + ID_SIZE) // 4) * 4  # the stamp is aligned to 4 in the body
    return _HEADER + stamp + _STAMP

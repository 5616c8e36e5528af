"""The texts that a leaf shows at its node of the tree: one line for people. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Sized
from typing import Any

from actionkit._model.printable import on_one_line
from actionkit._model.values import GoalState

_STATES = {
    GoalState.SENDING: "waits for a server, or its turn",
    GoalState.SENT: "sent, not answered so far",
    GoalState.ACCEPTED: "accepted",
    GoalState.EXECUTING: "executing",
    GoalState.CANCELING: "being cancelled",
    GoalState.RETRYING: "failed, and is tried again soon",
    GoalState.TIMED_OUT: "out of time, being cancelled",
}
_FIELDS = 3
"""Fields of the feedback that are shown: a tree's node has no room for more."""
_LOOKED_AT = 12
"""Fields that are searched for these, so that large messages do not take more time."""


def running(state: GoalState, feedback: Any) -> str:
    """Return the state of a goal, and its progress."""
    said = progress(feedback)
    word = _STATES.get(state, state.lower())
    return f"{word}: {said}" if said else word


def progress(feedback: Any) -> str:
    """Return the first fields of a feedback message; `""` where there is none."""
    if feedback is None:
        return ""
    shown = []
    for number, (path, value) in enumerate(_fields(feedback, "")):
        text = _text(value)
        if text:
            shown.append(f"{path}={text}")
        if len(shown) == _FIELDS or number >= _LOOKED_AT:
            break
    return on_one_line(", ".join(shown))


def _fields(message: Any, above: str) -> Iterator[tuple[str, Any]]:
    for name in message.get_fields_and_field_types():
        value = getattr(message, name)
        if hasattr(value, "get_fields_and_field_types"):
            yield from _fields(value, f"{above}{name}.")
        else:
            yield above + name, value


def _text(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:g}"
    if isinstance(value, (bool, int)):
        return str(value)
    if isinstance(value, str):
        return value if len(value) <= 40 else f"{value[:40]}..."
    return f"[{len(value)} items]" if isinstance(value, Sized) else ""


def succeeded(elapsed: float) -> str:
    """Return the text for a goal that succeeded."""
    return f"succeeded after {elapsed:.1f} s"


def waiting(goal_id: object, known: bool | None, refused: bool) -> str:
    """Return the text for a leaf that waits before it sends a new goal."""
    if refused and known:
        return f"the server refused to cancel the earlier goal {goal_id}: waits for its end"
    if known:
        return f"waits until the earlier goal {goal_id}, which was cancelled, has stopped"
    return f"waits for news of the earlier goal {goal_id}: its server has not answered, or is gone"


def may_still_run(goal_id: object, known: bool | None, why: str) -> str:
    """Return the text for a leaf that sent nothing, because an earlier goal may be running."""
    does = "still runs" if known else "MAY STILL BE RUNNING"
    return f"nothing was sent, because the earlier goal {goal_id} of this behaviour {does}{why}"

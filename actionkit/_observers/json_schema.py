"""Writes and reads the JSON lines of events and outcomes (described in docs/logging.md)."""

from __future__ import annotations

import json
import os
import uuid
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from actionkit._messages.json_text import to_json
from actionkit._model.field_errors import shown
from actionkit._model.values import GoalEvent, GoalState, Outcome
from actionkit._observers.protocol import CallInfo
from actionkit._observers.words import outcome_word

VERSION = 1
"""Of the schema. Fields may be added; existing fields keep their names and meanings."""
_NOTES = ("servers", "cancel", "stop", "hold", "leftover")
"""Kinds of lines that commands write, and that are not about a call."""


class NoteLine(ValueError):
    """The line has this schema, but it is not about a call."""


def event_line(event: GoalEvent, call: CallInfo, **more: object | None) -> str:
    """Return the line of an event; `more` is as for `event_data`.

    It may have `goal=` or `feedback=`, a message as plain data.
    """
    return to_json(event_data(event, call, os.getpid(), **more), compact_ascii=True)


def event_data(event: GoalEvent, call: CallInfo, pid: int, **more: object | None) -> dict[str, Any]:
    """Return what the line of an event says; `more` are further fields, without those of `None`."""
    return {
        **_head("event", call, pid),
        "goal_id": str(event.goal_id),
        "attempt": event.attempt,
        "state": event.state.value,
        "monotonic": event.monotonic,
        "wall": event.wall,
        "elapsed_ms": call.elapsed_ms(event),
        "detail": event.detail,
        "cancel_refused": event.cancel_refused,
        **{name: value for name, value in more.items() if value is not None},
    }


def outcome_line(
    outcome: Outcome[Any], call: CallInfo, result: Mapping[str, Any] | None, **more: Any
) -> str:
    """Return the line of a call's end; `result` is plain data, and `more` are further fields."""
    return to_json(
        {
            **_head("outcome", call, os.getpid()),
            "goal_id": str(outcome.goal_id),
            "state": outcome.status.value,
            "monotonic": call.monotonic + outcome.elapsed,
            "wall": call.wall + outcome.elapsed,
            "elapsed_ms": round(outcome.elapsed * 1000, 3),
            "ok": outcome.ok,
            "outcome": outcome_word(outcome),
            "error": None if outcome.error is None else str(outcome.error),
            "attempts": outcome.attempts,
            "cancel": None if outcome.cancel is None else outcome.cancel.value,
            "may_run": [str(goal.goal_id) for goal in outcome.goals if goal.fate.may_run],
            "feedback_count": outcome.feedback_count,
            "callback_errors": outcome.callback_errors,
            **({} if result is None else {"result": result}),
            **more,
        },
        compact_ascii=True,
    )


def note_line(kind: str, action_name: str, wall: float, **more: Any) -> str:
    """Return a line that is not about a call; `kind` is one of `_NOTES`.

    `action_name` is `""` if the line is not about an action. `wall` is in seconds since the epoch.
    """
    head = {"v": VERSION, "kind": kind, "pid": os.getpid(), "action_name": action_name}
    return to_json({**head, "wall": wall, **more}, compact_ascii=True)


def _head(kind: str, call: CallInfo, pid: int) -> dict[str, Any]:
    return {
        "v": VERSION,
        "kind": kind,
        "pid": pid,
        "call_id": str(call.call_id),
        "action_name": call.action_name,
        "action_type": call.action_type,
        "node_name": call.node_name,
    }


@dataclass(frozen=True)
class LoggedLine:
    """One line of a JSON lines file, read back.

    Attributes:
        kind: `"event"` or `"outcome"`.
        call_id: The id of the call's first goal; it stays the same for all attempts.
        action_name: The full name of the action.
        action_type: The action's type, such as `test_msgs/action/Fibonacci`.
        node_name: The full name of the client's `node=`, or `""` without one.
        pid: The process that wrote it.
        event: The event, equal to the original; `None` for an outcome.
        data: The whole line, with the messages in it.
    """

    kind: str
    call_id: uuid.UUID
    action_name: str
    action_type: str
    node_name: str
    pid: int
    event: GoalEvent | None
    data: Mapping[str, Any]


def parse_line(text: str | bytes) -> LoggedLine:
    """Return what a line says.

    Raises:
        NoteLine: It has this schema, but it is not about a call.
        ValueError: It does not have this schema; the text says why.
    """
    try:
        data = json.loads(text)
    except ValueError:
        raise ValueError("cut off, or no JSON") from None
    except RecursionError:
        raise ValueError("nested too deeply") from None
    if not isinstance(data, dict) or "v" not in data:
        raise ValueError("no line of ActionKit's")
    if data["v"] != VERSION:
        raise ValueError(f"of version {shown(data['v'])}; this ActionKit reads {VERSION}")
    if data.get("kind") in _NOTES:
        raise NoteLine
    try:
        _check(data)
        return LoggedLine(
            kind=data["kind"],
            call_id=uuid.UUID(data["call_id"]),
            action_name=data["action_name"],
            action_type=data["action_type"],
            node_name=data["node_name"],
            pid=int(data["pid"]),
            event=_event(data) if data["kind"] == "event" else None,
            data=data,
        )
    except (KeyError, TypeError, AttributeError, ValueError, OverflowError) as error:
        why = f"{type(error).__name__}: {error}"
        raise ValueError(f"of a strange form ({why[:_MOST_WHY]})") from None


_NUMBERS = ("monotonic", "wall", "elapsed_ms")
_TEXTS = ("kind", "action_name", "action_type", "node_name")
_MOST = 1e15
"""The largest time that is read, in seconds: 30 million years. The times of a file are added, and
floats of this size are still exact to a second."""
_MOST_WHY = 200
"""Characters of an error's reason, which may quote a long value."""


def _check(data: Mapping[str, Any]) -> None:
    """Raise if a field that other code reads is missing or has the wrong type."""
    for name in _NUMBERS:
        number = data[name]
        if isinstance(number, bool) or not isinstance(number, (int, float)):
            raise TypeError(f"{name} is no number")
        if not abs(number) <= _MOST:  # NaN is not, either
            raise ValueError(f"{name}={shown(number)} is no time")
    for name in _TEXTS:
        _check_text(name, data[name])
    if data["kind"] == "outcome":
        uuid.UUID(data["goal_id"])
        _check_text("outcome", data["outcome"])
        if data["error"] is not None:
            _check_text("error", data["error"])


def _check_text(name: str, value: object) -> None:
    if not isinstance(value, str):
        raise TypeError(f"{name} is no text")


def _event(data: Mapping[str, Any]) -> GoalEvent:
    return GoalEvent(
        goal_id=uuid.UUID(data["goal_id"]),
        attempt=int(data["attempt"]),
        state=GoalState(data["state"]),
        monotonic=float(data["monotonic"]),
        wall=float(data["wall"]),
        detail=str(data["detail"]),
        cancel_refused=data.get("cancel_refused", False) is True,  # older files do not have it
    )

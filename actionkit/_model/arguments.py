"""Checks arguments from users; the errors say what to do."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any

from actionkit._model.similar_names import similar_names


class Unset:
    """The type of an argument that was left out, where `None` means "no limit"."""

    def __repr__(self) -> str:
        return "<as the client's timeouts.total>"


UNSET = Unset()


def check_type(name: str, value: object, cls: type) -> None:
    """Raise a `TypeError` if `value` is not a `cls`."""
    if not isinstance(value, cls):
        raise TypeError(f"{name}={value!r} must be a {cls.__name__}")


def check_function(name: str, value: object, wanted: str) -> None:
    """Raise a `TypeError` if `value` is not callable, or is a class or a coroutine function.

    `wanted` is for the error, such as "a function (Outcome) -> Verdict".
    """
    if not callable(value):
        raise TypeError(f"{name}={value!r} must be {wanted}")
    if inspect.isclass(value):
        raise TypeError(
            f"{name}={value!r} must be {wanted}; this is a class: make an instance of it"
        )
    called = getattr(type(value), "__call__", None)  # noqa: B004  the method, for its kind
    if inspect.iscoroutinefunction(value) or inspect.iscoroutinefunction(called):
        raise TypeError(
            f"{name}={value!r} must be {wanted}; this is a coroutine function, and no event loop is"
            " there to run it: make it a plain one"
        )


_KNOWN_ELSEWHERE = {
    "timeout_sec": ("timeout", "rclpy's timeout_sec is called timeout here"),
    "feedback_callback": ("on_feedback", "rclpy's feedback_callback is called on_feedback here"),
    "goal_uuid": (
        "goal",
        "rclpy's goal_uuid is not needed: the client makes the goal's id, see GoalFuture.goal_id",
    ),
    "maximum": ("max_pause", "did you mean max_pause=?"),
    "multiplier": ("factor", "did you mean factor=?"),
    "retries": ("attempts", "did you mean attempts=? It includes the first one"),
}
"""Name in another library -> our name, and the hint for functions that have our name."""
_TIMEOUT_OF_CALLS = "belongs to a call: client.call(goal, timeout=3). A client has timeouts="
_FEEDBACK_OF_CALLS = "belongs to a call: client.call(goal, on_feedback=...)"
_QOS = (
    "cannot be set: the client uses the profiles that action servers have by default, with"
    " deeper queues"
)
OF_CLIENTS = {
    "timeout": f"timeout {_TIMEOUT_OF_CALLS}",
    "timeout_sec": f"rclpy's timeout_sec {_TIMEOUT_OF_CALLS}",
    "on_feedback": f"on_feedback {_FEEDBACK_OF_CALLS}",
    "feedback_callback": f"rclpy's feedback_callback {_FEEDBACK_OF_CALLS}",
    "callback_group": "rclpy's callback_group is not needed: no executor of yours runs callbacks"
    " of the client, it has threads of its own for them",
    "executor": "an executor is not needed: the client spins by itself",
    **{
        f"{name}_qos_profile": f"rclpy's {name}_qos_profile {_QOS}"
        for name in (
            "goal_service",
            "result_service",
            "cancel_service",
            "feedback_sub",
            "status_sub",
        )
    },
}


def refuse_unknown(
    unknown: Mapping[str, Any],
    function: Callable[..., Any],
    hints: Mapping[str, str] = MappingProxyType({}),
) -> None:
    """Raise a `TypeError` for keywords that a function does not have, with a hint.

    `function` has the right keywords; `hints` has texts for names that are special to it.
    """
    for name, value in unknown.items():
        known = [
            each.name
            for each in inspect.signature(function).parameters.values()
            if each.name != "self" and each.kind not in (each.VAR_POSITIONAL, each.VAR_KEYWORD)
        ]
        ours, hint = _KNOWN_ELSEWHERE.get(name, ("", ""))
        near = similar_names(name, known)
        if name in hints:
            hint = hints[name]
        elif ours in known:
            pass
        elif near:
            hint = f"did you mean {near[0]}=?"
        else:
            hint = f"there {'is' if len(known) == 1 else 'are'} {', '.join(known)}"
        raise TypeError(f"unknown argument {name}={value!r}: {hint}")


def refuse_misplaced(action_type: object, action_name: object, misplaced: Sequence[object]) -> None:
    """Raise a `TypeError` if a client got its arguments in rclpy's order, or too many of them."""
    if isinstance(action_name, type) and misplaced:
        raise TypeError(
            "rclpy's order is ActionClient(node, type, name); here it is"
            f" Client({action_name.__name__}, {misplaced[0]!r}, node=...), and node= may be left"
            " out"
        )
    if isinstance(action_name, type):
        name = action_name.__name__
        raise TypeError(f"the action's type comes first: Client({name}, {action_type!r})")
    if misplaced:
        raise TypeError(
            f"{misplaced[0]!r} must be given by its name, such as node= or timeouts=: only the"
            " action's type and its name are known by their places"
        )

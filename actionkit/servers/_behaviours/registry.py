"""Finds reference servers by name. No rclpy here, so that listing them does not need it."""

from __future__ import annotations

from actionkit.servers._behaviours import basic, faulty, queueing, restarting, rich
from actionkit.servers._behaviours.behaviour import Behaviour
from actionkit.servers._behaviours.scripted import Scripted

_BEHAVIOURS: dict[str, type[Behaviour]] = {
    "aborts": faulty.Aborts,
    "blocking": faulty.Blocking,
    "cancels_itself": faulty.CancelsItself,
    "countdown": basic.Countdown,
    "crashes": faulty.Crashes,
    "error_code": rich.ErrorCode,
    "expires": faulty.Expires,
    "fibonacci": basic.Fibonacci,
    "flaky": restarting.Flaky,
    "floods": rich.Floods,
    "guarded": queueing.Guarded,
    "ignores_cancel": faulty.IgnoresCancel,
    "navigate": rich.Navigate,
    "never_finishes": faulty.NeverFinishes,
    "no_result": faulty.NoResult,
    "preemptive": queueing.Preemptive,
    "queued": queueing.Queued,
    "raises": faulty.Raises,
    "refuses_cancel": faulty.RefusesCancel,
    "restarts": restarting.Restarts,
    "scripted": Scripted,
    "silent": faulty.Silent,
    "slow_accept": basic.SlowAccept,
    "slow_cancel": faulty.SlowCancel,
    "twins": basic.Twins,
    "vanishes": faulty.Vanishes,
    "wrong_type": faulty.WrongType,
}


def names() -> dict[str, str]:
    """Return the reference servers: name -> description in one line, sorted."""
    return {name: (cls.__doc__ or "").splitlines()[0] for name, cls in _BEHAVIOURS.items()}


def behaviour_named(name: str) -> type[Behaviour]:
    """Return the behaviour with that name.

    Raises:
        ValueError: There is no such behaviour.
    """
    try:
        return _BEHAVIOURS[name]
    except KeyError:
        raise ValueError(
            f"no reference server {name!r}; there are: {', '.join(_BEHAVIOURS)}"
        ) from None


def is_foreign(server: str, name: str) -> bool:
    """Return whether a type is not the reference server's own, but is served all the same.

    `name` is the type's name, such as `test_msgs/action/Fibonacci`.

    Raises:
        ValueError: There is no such server, or it makes no sense for that type.
    """
    behaviour = behaviour_named(server)
    known = (behaviour.action_type, *behaviour.other_types)
    foreign = name not in known
    if foreign and not behaviour.any_type:
        able = ", ".join(sorted(key for key, cls in _BEHAVIOURS.items() if cls.any_type))
        raise ValueError(
            f"the {server} server is about the fields of {' or '.join(known)} and cannot serve"
            f" {name}. Those that serve any type are: {able}"
        )
    return foreign

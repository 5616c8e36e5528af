"""Checks arguments from users; the errors say what to do."""

from __future__ import annotations

import inspect


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

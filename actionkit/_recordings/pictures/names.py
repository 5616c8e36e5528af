"""Shortens names for a picture."""

from __future__ import annotations

from collections.abc import Iterable


def shortened(names: Iterable[str], most: int) -> dict[str, str]:
    """Return a short form of each name, with at most `most` characters; they stay different.

    The end of a name is the most important part. So the beginning is left out or, if two names
    would then be the same, the middle.
    """
    every = dict.fromkeys(names)
    long = [name for name in every if len(name) > most]
    for kept in range(most):
        short = {name: _without_middle(name, kept, most) for name in long}
        if len(set(short.values())) == len(long):
            break
    else:
        short = {name: _numbered(name, number, most) for number, name in enumerate(long, 1)}
    return {name: short.get(name, name) for name in every}


def _without_middle(name: str, kept: int, most: int) -> str:
    """Return a name of `most` characters; the first `kept` and the last ones are its own."""
    return f"{name[:kept]}…{name[len(name) - (most - 1 - kept) :]}"


def _numbered(name: str, number: int, most: int) -> str:
    return f"{number}: {_without_middle(name, 0, most - len(f'{number}: '))}"

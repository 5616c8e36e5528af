"""Short forms of names, for a picture that has not room for all of them."""

from __future__ import annotations

from collections.abc import Iterable


def shortened(names: Iterable[str], most: int) -> dict[str, str]:
    """Return what to write for each name; different names stay different.

    The end of a name says most. So its beginning is left out, or, where two would then be the same,
    what is in the middle.

    Args:
        names: The names.
        most: How many characters there is room for.
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
    """Return a name of `most` characters that begins with `kept` of its own."""
    return f"{name[:kept]}…{name[len(name) - (most - 1 - kept) :]}"


def _numbered(name: str, number: int, most: int) -> str:
    return f"{number}: {_without_middle(name, 0, most - len(f'{number}: '))}"

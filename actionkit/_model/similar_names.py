"""Finds similar names, for a hint "did you mean"."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

_LAST_PART_ALIKE = 0.8
"""The necessary similarity of the last parts: higher, because they are short."""
_MOST = 5
"""Names in a hint at most; more do not help."""


def similar_names(name: str, known: Iterable[str], *, alike: float = 0.6) -> list[str]:
    """Return the known names that are like `name` as a whole or in the part behind the last `/`.

    Mostly the namespace or the package is wrong. `alike` is the necessary similarity of the whole
    names, from 0 to 1; 0.6 is the default of `difflib`.
    """
    names = list(known)
    similar = difflib.get_close_matches(name, names, n=3, cutoff=alike)
    tails = {_tail(each) for each in names}
    near = difflib.get_close_matches(_tail(name), tails, n=3, cutoff=_LAST_PART_ALIKE)
    similar += [each for each in names if _tail(each) in near and each not in similar]
    return similar[:_MOST]


def _tail(name: str) -> str:
    return name.rsplit("/", 1)[-1]

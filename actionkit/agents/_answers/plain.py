"""Messages as JSON values of a size that a language model can read."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

from actionkit._messages.convert import to_plain
from actionkit._messages.json_text import to_json
from actionkit._model.printable import visible

_MOST_CHARACTERS = 20_000
"""Of the whole as JSON: some thousand words of a model."""
_MOST_ITEMS = 100
_LONGEST_TEXT = 4000


def plain_json(
    message: object,
    max_items: int = _MOST_ITEMS,
    most_characters: int = _MOST_CHARACTERS,
    escape: bool = True,
) -> dict[str, Any]:
    """Return a message as a JSON object; NaN and the infinities become strings.

    Arrays and texts that are too long are cut, and their last element, or end, says how much is
    missing. Where the whole is still too large, they are cut shorter.

    Args:
        message: Any ROS message.
        max_items: The most elements of an array.
        most_characters: Of the whole as JSON, where cutting arrays and texts does it.
        escape: Whether characters that cannot be seen are escaped, such as `\\u200b`.
    """
    change = visible if escape else str
    longest = _LONGEST_TEXT
    while True:
        plain = _with_texts(to_plain(message, max_items=max_items), longest, change)
        text = to_json(plain)
        if len(text) <= most_characters or (max_items <= 1 and longest <= 1):
            return json.loads(text)  # type: ignore[no-any-return]
        max_items, longest = max(1, max_items // 4), max(1, longest // 4)


def _with_texts(value: Any, longest: int, change: Callable[[str], str]) -> Any:
    if isinstance(value, str):
        more = len(value) - longest
        if more <= 40:
            return change(value)
        return f"{change(value[:longest])}… {more} more characters"
    if isinstance(value, dict):
        return {name: _with_texts(item, longest, change) for name, item in value.items()}
    if isinstance(value, list):
        return [_with_texts(item, longest, change) for item in value]
    return value

"""Escapes characters in foreign texts, for terminals, logs and programs that read JSON.

A terminal obeys escape sequences in any text, such as a node's name. Half a character (a lone
surrogate, which can be in JSON and in file names) cannot be written at all.
"""

from __future__ import annotations

import unicodedata

# In the notation of JSON, so that JSON keeps its meaning.
_ESCAPES = {
    code: f"\\u{code:04x}"
    for codes in (
        range(0x20),  # control characters, also escape
        range(0x7F, 0xA0),  # more of them; for some terminals, 0x9b begins an escape sequence
        (0x061C, 0x200E, 0x200F),  # marks that change the direction of writing,
        range(0x2028, 0x202F),  # line separators, and more such marks
        range(0x2066, 0x206A),
        range(0xD800, 0xE000),  # lone surrogates
    )
    for code in codes
}
_ESCAPES.update({ord("\n"): "\\n", ord("\r"): "\\r", ord("\t"): "\\t"})
_LAYOUT = {ord("\n"), ord("\t")}
_HIDDEN_CATEGORIES = ("Cc", "Cf", "Co", "Cs", "Zl", "Zp")
_HIDDEN = frozenset(
    (0x034F, 0x115F, 0x1160, 0x17B4, 0x17B5, 0x3164, 0xFFA0, *range(0xFE00, 0xFE10))
) | frozenset(range(0xE0100, 0xE01F0))
"""Letters and marks that show nothing: fillers, and what selects a form of a character."""
_ESCAPES_BUT_LAYOUT = {code: text for code, text in _ESCAPES.items() if code not in _LAYOUT}


def printable(text: str) -> str:
    r"""Return the text with harmful characters escaped, such as `\u001b`, except newlines."""
    return text.translate(_ESCAPES_BUT_LAYOUT)


def visible(text: str) -> str:
    r"""Return the text with all that cannot be seen escaped, such as `\u200b`, except newlines.

    For what a human approves, and for what a language model reads: neither can see it, but the
    model obeys it. Some scripts and emoji are joined by such characters, and look worse for it.
    """
    return text if text.isascii() and text.isprintable() else "".join(map(_visible, text))


def _visible(character: str) -> str:
    code = ord(character)
    hidden = unicodedata.category(character) in _HIDDEN_CATEGORIES or code in _HIDDEN
    if not hidden or code in _LAYOUT:
        return character
    units = character.encode("utf-16-be", "surrogatepass")
    return "".join(f"\\u{units[i : i + 2].hex()}" for i in range(0, len(units), 2))


def full_stop(text: str) -> str:
    """Return the text with a full stop at its end, so that another sentence may follow."""
    return text if text.endswith((".", "!", "?")) else f"{text}."


def on_one_line(text: str) -> str:
    """Return the text with newlines and tabs escaped, too."""
    return text.translate(_ESCAPES)

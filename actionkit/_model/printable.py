"""Escapes characters in foreign texts, for terminals, logs and programs that read JSON.

A terminal obeys escape sequences in any text, such as a node's name. Half a character (a lone
surrogate, which can be in JSON and in file names) cannot be written at all.
"""

from __future__ import annotations

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
_ESCAPES_BUT_LAYOUT = {code: text for code, text in _ESCAPES.items() if code not in _LAYOUT}


def printable(text: str) -> str:
    r"""Return the text with harmful characters escaped, such as `\u001b`, except newlines."""
    return text.translate(_ESCAPES_BUT_LAYOUT)


def full_stop(text: str) -> str:
    """Return the text with a full stop at its end, so that another sentence may follow."""
    return text if text.endswith((".", "!", "?")) else f"{text}."


def on_one_line(text: str) -> str:
    """Return the text with newlines and tabs escaped, too."""
    return text.translate(_ESCAPES)

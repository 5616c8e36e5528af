"""Texts that others wrote, made harmless: for a terminal, a log, and a program that reads JSON.

A terminal obeys escape sequences, be they in a node's name or in a file. Half a character (a lone
surrogate, which JSON and file names can bring) cannot be written at all.
"""

from __future__ import annotations

# In the notation of JSON, so that JSON stays the same JSON.
_ESCAPES = {
    code: f"\\u{code:04x}"
    for codes in (
        range(0x20),  # control characters, escape among them
        range(0x7F, 0xA0),  # more of them; some terminals take 0x9b for an escape sequence's begin
        (0x061C, 0x200E, 0x200F),  # marks that turn the direction of writing,
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
    r"""Return the text with all that is not to be printed escaped as `\u001b`, lines left alone."""
    return text.translate(_ESCAPES_BUT_LAYOUT)


def full_stop(text: str) -> str:
    """Return the text with a full stop, unless it ends as a sentence does: another may follow."""
    return text if text.endswith((".", "!", "?")) else f"{text}."


def on_one_line(text: str) -> str:
    """Return the text with newlines and tabs escaped, too."""
    return text.translate(_ESCAPES)

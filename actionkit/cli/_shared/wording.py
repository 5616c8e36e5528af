"""Changes the library's error texts for the command line: options instead of Python code."""

from __future__ import annotations

import re

_WORDS = {
    "with timeout= and Timeouts(server=...)": "with --timeout and --server-timeout",
    "timeout=0 leaves": "--timeout 0 leaves",
    "Give it more time": "Give it more time with --timeout",
    "give the call more time": "give the call more time with --timeout",
    "Timeouts(accept=...)": "--accept-timeout",
    "Timeouts(feedback=...)": "--feedback-timeout",
    "Timeouts(cancel=...)": "--cancel-timeout",
    "timeout= or Timeouts(result=...)": "--timeout or --result-timeout",
    "came late, and is in `late_result`": "came late",
    "What the server sent with it is in `error.result`; its log may say more": "Look at the result,"
    " and at the server's log",
    " It is in `error.result`.": "",
    " The result is in `error.result`.": "",
    "by `classify=`": "by --ok and --transient",
    "Correct that function: it has to return a Verdict, or None where it has no opinion, in the"
    " time that is left to the call, and within 10 s": "Name a field that every result has",
    ": let that function return None for it, or another Verdict": "",
    "close(), or leave the `with` block later": "you end the command",
}
"""Phrases for Python users in the texts of `_calls/errors/error_texts.py` -> our phrases."""
_PATTERNS = {
    # Texts that these quote, and errors from making a client.
    r"`classify=<[^`]*>` raised \w+": "--ok or --transient does not fit the result",
    r"`classify=<[^`]*>`": "--ok or --transient",
    r"the retry policy allows one attempt": "without --retries there is one attempt",
    r"attempts of the retry policy are": "attempts that --retries allows are",
    r" \(resend=[^)]*\)": "",
    r"the retry budget forbids it \(<[^>]*>\)": "too many attempts failed",
    # A part of that time may have gone by before the call, in a look for the type.
    r"the time given to the call, [\d.e+-]+ s,": "the time of --timeout",
    r"within [\d.e+-]+ s, the time given to the call": "within the time of --timeout",
    r"classify_by_field(\([^)]*\))?: ": "--ok or --transient: ",
    r"\baction_name=": "the name ",
    r"give node= the node that is meant, or give the whole name": "give the whole name",
}
_ALL = {**{re.escape(python): ours for python, ours in _WORDS.items()}, **_PATTERNS}


def in_options(text: str) -> str:
    """Return an error's text with names of options in place of Python names."""
    for python, ours in _ALL.items():
        text = re.sub(python, ours, text)
    return text

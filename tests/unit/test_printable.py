"""Foreign texts are escaped for a terminal, a file and JSON."""

from __future__ import annotations

import json
import unicodedata

import pytest
from hypothesis import given
from hypothesis import strategies as st

from actionkit._model.printable import full_stop, on_one_line, printable, visible


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("plain text, ünïcode, 漢字, 👩‍🚀", "plain text, ünïcode, 漢字, 👩‍🚀"),
        ("two\n\tlines", "two\n\tlines"),
        ("\x1b[31mred\x1b[0m", r"\u001b[31mred\u001b[0m"),
        ("\x9b31m", r"\u009b31m"),
        ("over\rwritten\x08", r"over\rwritten\u0008"),
        ("\x00\x7f", r"\u0000\u007f"),
        ("\ud800", r"\ud800"),
        ("\u202eturned\u2066", r"\u202eturned\u2066"),
        ("\u2028", r"\u2028"),
    ],
)
def test_what_would_control_a_terminal_is_escaped(text: str, expected: str) -> None:
    assert printable(text) == expected


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("plain", "plain"),
        ("two\n\tlines, ünïcode, 漢字", "two\n\tlines, ünïcode, 漢字"),
        ("a\u200bb\u00ad\x1b", r"a\u200bb\u00ad\u001b"),
        (
            "fill \u3164\u115f, select \ufe0f\U000e0100",
            r"fill \u3164\u115f, select \ufe0f\udb40\udd00",
        ),
        ("\U000e0041\ue000\u2028", r"\udb40\udc41\ue000\u2028"),
        ("half \ud800", r"half \ud800"),
    ],
)
def test_what_cannot_be_seen_is_escaped(text: str, expected: str) -> None:
    assert visible(text) == expected


def test_on_one_line() -> None:
    assert on_one_line("two\n\tlines\x1b") == r"two\n\tlines\u001b"


@pytest.mark.parametrize("said", ["no", "No.", "never!", "why?", "it ends in a stop..."])
def test_what_others_say_is_a_sentence_of_its_own(said: str) -> None:
    assert full_stop(said) == {"no": "no."}.get(said, said)


ANY = st.text(st.characters())


@given(ANY)
def test_any_text_can_be_printed(text: str) -> None:
    for shown in (printable(text), on_one_line(text)):
        shown.encode()
        left = {c for c in shown if unicodedata.category(c) in ("Cc", "Cs", "Zl", "Zp")}
        assert left <= {"\n", "\t"}
        assert printable(shown) == shown
    assert not {"\n", "\t"} & set(on_one_line(text))


@given(ANY)
def test_nothing_is_hidden_in_what_is_visible(text: str) -> None:
    shown = visible(text)
    shown.encode()
    left = {c for c in shown if unicodedata.category(c) in ("Cc", "Cf", "Cs", "Zl", "Zp", "Co")}
    assert left <= {"\n", "\t"}
    assert visible(shown) == shown
    quoted = visible(json.dumps(text, ensure_ascii=False))
    assert json.loads(quoted).encode("utf-16", "surrogatepass") == text.encode(
        "utf-16", "surrogatepass"
    )


@given(st.dictionaries(ANY, ANY))
def test_json_stays_the_same_json(value: dict[str, str]) -> None:
    text = printable(json.dumps(value, ensure_ascii=False))
    assert json.loads(text) == value

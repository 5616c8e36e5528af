"""Data as JSON: strict, on one line, with one spelling of NaN and the infinities."""

from __future__ import annotations

import json
import math

import pytest

from actionkit._messages.json_text import to_json


@pytest.mark.parametrize("compact_ascii", [False, True])
def test_json_has_no_numbers_that_json_does_not_know(compact_ascii: bool) -> None:
    data = {"a": math.nan, "b": [math.inf, {"c": -math.inf}], "d": 1.5, "e": (math.nan,)}
    line = to_json(data, compact_ascii=compact_ascii)
    read = json.loads(line, parse_constant=pytest.fail)
    assert read == {"a": "NaN", "b": ["Infinity", {"c": "-Infinity"}], "d": 1.5, "e": ["NaN"]}
    assert math.isnan(float(read["a"]))
    assert [float(read["b"][0]), float(read["b"][1]["c"])] == [math.inf, -math.inf]


def test_a_record_is_one_line_for_people_or_compact_ascii_for_files() -> None:
    data = {"text": "zwei\nÄpfel", "n": [1, 2]}
    assert to_json(data) == '{"text": "zwei\\nÄpfel", "n": [1, 2]}'
    assert to_json(data, compact_ascii=True) == '{"text":"zwei\\n\\u00c4pfel","n":[1,2]}'

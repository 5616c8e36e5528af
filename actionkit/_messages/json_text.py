"""Writes data with messages in it as JSON, with one spelling of NaN and the infinities."""

from __future__ import annotations

import json
import math
from typing import Any


def to_json(data: dict[str, Any], *, compact_ascii: bool = False) -> str:
    """Return the data as one line of strict JSON, without a newline.

    JSON has no numbers for NaN and the infinities. They become the strings "NaN", "Infinity" and
    "-Infinity", as in the JSON of Protocol Buffers; `float()` and JavaScript's `Number()` read
    these. `compact_ascii` is for files: without spaces, and with all other characters escaped.
    """
    separators = (",", ":") if compact_ascii else None

    def dump(value: Any) -> str:
        return json.dumps(value, ensure_ascii=compact_ascii, allow_nan=False, separators=separators)

    try:
        return dump(data)
    except ValueError:  # NaN or an infinity; most lines have neither
        return dump(_spelled_out(data))


def _spelled_out(value: Any) -> Any:
    if isinstance(value, float) and not math.isfinite(value):
        return "NaN" if math.isnan(value) else "Infinity" if value > 0 else "-Infinity"
    if isinstance(value, dict):
        return {name: _spelled_out(item) for name, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_spelled_out(item) for item in value]
    return value

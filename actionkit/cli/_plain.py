"""How messages are written: YAML for people, JSON for programs."""

from __future__ import annotations

import json
import math
import textwrap
from typing import Any

import yaml

from actionkit._messages.convert import to_plain


class _Dumper(yaml.SafeDumper):
    """Block style, but each array of plain values on a line: a path has thousands of numbers."""

    def represent_sequence(self, tag: str, sequence: Any, flow_style: bool | None = None) -> Any:
        plain = not any(isinstance(item, (dict, list)) for item in sequence)
        return super().represent_sequence(tag, sequence, flow_style=plain)

    def ignore_aliases(self, data: Any) -> bool:
        return True  # write what is there twice, twice


def as_yaml(message: Any, indent: str = "    ") -> str:
    """Return a message as YAML, indented, with its last newline."""
    plain = to_plain(message)
    if not plain:
        return f"{indent}{{}}\n"
    text = yaml.dump(plain, Dumper=_Dumper, sort_keys=False, allow_unicode=True, width=math.inf)
    return textwrap.indent(text, indent)


def as_json(record: dict[str, Any]) -> str:
    """Return a record as one line of JSON, without a newline.

    JSON has no numbers for nan and the infinities: they become "NaN", "Infinity", "-Infinity".
    """
    return json.dumps(_finite(record), ensure_ascii=False, allow_nan=False)


def _finite(value: Any) -> Any:
    if isinstance(value, float) and not math.isfinite(value):
        return "NaN" if math.isnan(value) else f"{'-' if value < 0 else ''}Infinity"
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(item) for item in value]
    return value

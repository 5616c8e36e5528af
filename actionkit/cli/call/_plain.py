"""Writes messages as YAML for people."""

from __future__ import annotations

import math
import textwrap
from typing import Any

import yaml

from actionkit._messages.convert import to_plain


class _Dumper(yaml.SafeDumper):
    """Block style, but an array of plain values is one line: a path has thousands of numbers."""

    def represent_sequence(self, tag: str, sequence: Any, flow_style: bool | None = None) -> Any:
        plain = not any(isinstance(item, (dict, list)) for item in sequence)
        return super().represent_sequence(tag, sequence, flow_style=plain)

    def ignore_aliases(self, data: Any) -> bool:
        return True  # write equal values in full, without references


def as_yaml(message: Any, indent: str = "    ") -> str:
    """Return a message as indented YAML that ends with a newline."""
    plain = to_plain(message)
    if not plain:
        return f"{indent}{{}}\n"
    text = yaml.dump(plain, Dumper=_Dumper, sort_keys=False, allow_unicode=True, width=math.inf)
    return textwrap.indent(text, indent)

"""How messages are written: YAML for people, JSON for programs."""

from __future__ import annotations

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

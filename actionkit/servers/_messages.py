"""The messages of the action in use. Only the server's own process makes them."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from typing import Any

from ._run import Content


class Messages:
    """Makes results and feedback out of plain values."""

    def __init__(self, spec: str) -> None:
        self.action = generated(spec)

    def result(self, content: Content) -> Any:
        return _filled(self.action.Result(), content)

    def feedback(self, content: Content) -> Any:
        return _filled(self.action.Feedback(), content)


def generated(spec: str) -> Any:
    """A generated message class, as ``"package.module:Class"``; these have no types to check."""
    module, _, name = spec.partition(":")
    return getattr(importlib.import_module(module), name)


def _filled(message: Any, content: Content) -> Any:
    if isinstance(content, Mapping):
        for path, value in content.items():
            *parents, field = path.split(".")
            part = message
            for parent in parents:
                part = getattr(part, parent)
            setattr(part, field, value)
    elif hasattr(message, "sequence"):  # others stay at their defaults
        message.sequence = list(content)
    return message

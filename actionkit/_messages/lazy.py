"""Messages that are decoded when they are first used."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any

from actionkit._threads.diagnostics import log_here


class UndecodableError(Exception):
    """The bytes of a message do not fit its type. Code that uses the message leaves it out."""


class LazyMessage:
    """A serialised message that is decoded at most once, when it is first used."""

    __slots__ = ("_pending", "_value")

    def __init__(self, decode: Callable[[bytes], Any], message: bytes) -> None:
        self._pending: tuple[Callable[[bytes], Any], bytes] | None = (decode, message)
        self._value: Any = None

    def __call__(self) -> Any:
        """Return the message.

        Raises:
            UndecodableError: It cannot be decoded, which is logged once.
        """
        pending = self._pending
        if pending is not None:
            # Two threads may both decode. That does no harm: the values are equal.
            decode, message = pending
            try:
                self._value = decode(message)
            except Exception as error:  # noqa: BLE001  any error that bad bytes cause
                self._value = UndecodableError(str(error))
                log_here(logging.WARNING, "feedback is left out: %s", error)
            self._pending = None
        if isinstance(self._value, UndecodableError):
            raise self._value
        return self._value

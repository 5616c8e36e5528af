"""A job that a test lets go when it wants to."""

from __future__ import annotations

import threading

LONG = 20.0
"""Seconds: the bound of waits that are over at once if all is well."""


class Gate:
    """A job that runs until it is let go."""

    def __init__(self) -> None:
        self.entered, self.leave = threading.Event(), threading.Event()
        self.thread: threading.Thread | None = None

    def __call__(self) -> None:
        self.thread = threading.current_thread()
        self.entered.set()
        assert self.leave.wait(LONG)

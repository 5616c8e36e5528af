"""Remembers Ctrl-C from the first line of a command on.

Python can lose a KeyboardInterrupt while modules are imported: it becomes an ImportError or a
RuntimeError, or a callback of the import system swallows it.
"""

from __future__ import annotations

import signal
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

_came = False


@contextmanager
def remembered() -> Iterator[None]:
    """Raise KeyboardInterrupt at Ctrl-C, and once more at the end if it was lost.

    If SIGINT is ignored, it stays so.
    """
    global _came  # noqa: PLW0603
    _came = False
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _remember)
    try:
        yield
        check()
    except Exception:  # an import can turn Ctrl-C into any error
        check()
        raise
    finally:
        if signal.getsignal(signal.SIGINT) is _remember:
            signal.signal(signal.SIGINT, signal.default_int_handler)


def check() -> None:
    """Raise KeyboardInterrupt if Ctrl-C came and was lost. Call it before anything is sent."""
    if _came:
        raise KeyboardInterrupt


def be_quiet() -> None:
    """Print no warnings about what is left half-made, such as an event loop or a module."""
    sys.unraisablehook = lambda _: None
    warnings.simplefilter("ignore")
    if (log := sys.modules.get("asyncio.log")) is not None:
        log.logger.disabled = True  # of a task that Ctrl-C has ended, it prints a traceback


def _remember(number: int, frame: FrameType | None) -> None:
    global _came  # noqa: PLW0603
    _came = True
    be_quiet()
    raise KeyboardInterrupt

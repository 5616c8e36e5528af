"""Keeps standard output for what the command says: Fast DDS writes its errors there."""

from __future__ import annotations

import io
import os
import sys


def keep_clean() -> None:
    """Send what libraries write to standard output to standard error from now on.

    Python's own `sys.stdout` goes on to where it went. Once is enough, twice does no harm.
    """
    try:
        if sys.stdout.fileno() != 1:
            return
        sys.stdout.flush()
        kept = os.dup(1)
        os.dup2(2, 1)
    except (AttributeError, OSError, io.UnsupportedOperation):
        return  # no real output, or no standard error to take it
    before = sys.stdout
    sys.stdout = os.fdopen(
        kept, "w", encoding=before.encoding, errors=before.errors, buffering=1, closefd=False
    )

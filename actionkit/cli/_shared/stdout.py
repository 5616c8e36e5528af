"""Keeps standard output for the command's own output, because Fast DDS writes errors there.

Opens it where it is closed.
"""

from __future__ import annotations

import io
import os
import sys


def keep_clean() -> None:
    """From now on, redirect standard output of libraries to standard error.

    Python's `sys.stdout` still goes to standard output. Calling this twice does no harm.
    """
    try:
        if sys.stdout.fileno() != 1:
            return
        sys.stdout.flush()
        kept = os.dup(1)
        os.dup2(2, 1)
    except (AttributeError, OSError, io.UnsupportedOperation):
        return  # there is no real output, or no standard error
    before = sys.stdout
    sys.stdout = os.fdopen(
        kept, "w", encoding=before.encoding, errors=before.errors, buffering=1, closefd=False
    )


def open_closed() -> None:
    """Open the standard streams that are closed, as by `>&-`.

    Else the next file or socket gets their number, and libraries write into it. Our own output
    fails: nobody gets it. Errors are dropped.
    """
    for name, flags in (("stdin", os.O_WRONLY), ("stdout", os.O_RDONLY), ("stderr", os.O_WRONLY)):
        if getattr(sys, name) is None:
            number = os.open(os.devnull, flags)
            stream = os.fdopen(number, "r" if name == "stdin" else "w", closefd=False)
            setattr(sys, name, stream)

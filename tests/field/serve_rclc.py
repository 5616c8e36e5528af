"""Serves by the library that `tests.field.rclc` has built, until its standard input ends."""

from __future__ import annotations

import ctypes
import os
import sys
import threading

import rclpy  # noqa: F401  its libraries are those that rclc needs

_LINES = 1
"""C's `_IOLBF`: each line is written when it ends."""


def main() -> None:
    """Serve."""
    threading.Thread(target=_end_with_input, daemon=True).start()
    libc = ctypes.CDLL(None)
    libc.setvbuf(ctypes.c_void_p.in_dll(libc, "stdout"), None, _LINES, ctypes.c_size_t(4096))
    ctypes.CDLL(sys.argv[1]).srv_main()


def _end_with_input() -> None:
    sys.stdin.read()
    os._exit(0)  # the server itself never ends


if __name__ == "__main__":
    main()

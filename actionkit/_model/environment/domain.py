"""Reads the ROS domain from the environment, in the same way as rcl."""

from __future__ import annotations

import ctypes
import errno
import os
from dataclasses import dataclass

VARIABLE = "ROS_DOMAIN_ID"
LAST_DOMAIN = 232
"""The ports of higher domains do not exist; Fast DDS ends the process there."""
_OF_RCL = 2**64 - 1
"""rcl's number for "the default", which is domain 0."""


@dataclass(frozen=True)
class Domain:
    """A ROS domain in place of a client's node: the context is ours, even if the user has one."""

    id: int | None  # `None` means that of the environment


def environment_domain() -> int:
    """Return the ROS domain of the environment; 0 if none is set.

    Raises:
        ValueError: The text is not a ROS domain.
    """
    return domain_of_text(os.environ.get(VARIABLE, ""))


def domain_of_text(text: str) -> int:
    """Return the domain that rcl reads from a text: 8 from `010`, for example.

    rcl reads a number as C does, and ignores the text after it.

    Raises:
        ValueError: It is not a ROS domain.
    """
    rest = ctypes.c_char_p()
    read = ctypes.CDLL(None, use_errno=True).strtoul
    read.restype, read.argtypes = ctypes.c_ulong, [ctypes.c_char_p, ctypes.c_void_p, ctypes.c_int]
    ctypes.set_errno(0)
    domain: int = read(os.fsencode(text), ctypes.byref(rest), 0)
    no_number = (domain == 0 and rest.value) or ctypes.get_errno() == errno.ERANGE
    if no_number or LAST_DOMAIN < domain != _OF_RCL:
        raise ValueError(
            f"{VARIABLE}={text!r} in the environment is not a ROS domain: set it to a whole number"
            f" from 0 to {LAST_DOMAIN}, best up to 101"
        )
    return domain % _OF_RCL

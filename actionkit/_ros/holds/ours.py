"""Makes a new hold in the name of this user. Does not need rclpy, which is imported later."""

from __future__ import annotations

import getpass
import os
import socket
import time
import uuid

from actionkit._ros.holds.state import Hold

_LONGEST = 200
"""Characters; names of users and computers are shorter than that."""


def new_hold() -> Hold:
    """Return a new hold of this user."""
    return Hold(time.time(), uuid.uuid4().hex, who_we_are())


def who_we_are() -> str:
    """Return `user@host`."""
    try:
        user = getpass.getuser()
    except (OSError, KeyError):  # in a container, a user may have no name
        user = f"user-{os.getuid()}"
    return f"{user}@{socket.gethostname()}"[:_LONGEST]

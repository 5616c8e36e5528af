"""Our name, and a hold of ours. No rclpy here: it is imported after a hold was asked for."""

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
    """Return a hold of this user's."""
    return Hold(time.time(), uuid.uuid4().hex, who_we_are())


def who_we_are() -> str:
    """Return `user@host`."""
    try:
        user = getpass.getuser()
    except (OSError, KeyError):  # a container's user without a name
        user = f"user-{os.getuid()}"
    return f"{user}@{socket.gethostname()}"[:_LONGEST]

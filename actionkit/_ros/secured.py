"""Tells errors of security (SROS 2) from others: rclpy has no class for them."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from rclpy.context import Context

from actionkit._model.errors import SecurityError
from actionkit._model.security import security
from actionkit._ros.native import RCLError, is_up


@contextmanager
def explained(context: Context) -> Iterator[None]:
    """Explain errors about a node or what is on it, where security is on.

    Raises:
        SecurityError: In place of an `RCLError`.
    """
    try:
        yield
    except RCLError as error:
        if is_up(context):  # else that is the reason
            raise_if_secured(error)
        raise


def raise_if_secured(error: Exception) -> None:
    """Explain an error of rclpy, if security is on.

    Raises:
        SecurityError: It is on.
    """
    settings = security(os.environ, sys.argv)
    if settings is None or not settings.enforced:
        return
    said = str(error).partition(", at /")[0].partition(", at rmw")[0].rstrip(".")
    raise SecurityError(
        f"ROS security keeps this process out, as enclave {settings.enclave!r} of the keystore"
        f" {settings.keystore!r}: {settings.problem() or f'{said}.'} `actionkit doctor` checks the"
        " settings and the files. A program chooses its enclave with --ros-args --enclave NAME, or"
        " ROS_SECURITY_ENCLAVE_OVERRIDE; its policy must allow the action."
    ) from error

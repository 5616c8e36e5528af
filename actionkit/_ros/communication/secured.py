"""Tells errors of security (SROS 2) from others: rclpy has no class for them."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from rclpy.context import Context

from actionkit._model.environment.security import security
from actionkit._model.errors import SecurityError
from actionkit._ros.rclpy_private.native import RCLError, is_up

_SIGNS = ("ecurity", "ermission", "not allowed", "unknown reasons", "error not set")
"""What the errors of rcl and the middlewares have in their texts; the last two are CycloneDDS's."""


@contextmanager
def explained(context: Context, *, own: bool) -> Iterator[None]:
    """Explain errors about a node or what is on it, where security is on.

    `own` means that the context is ours, with the enclave of the process.

    Raises:
        SecurityError: In place of an `RCLError`.
    """
    try:
        yield
    except RCLError as error:
        if is_up(context) and any(sign in str(error) for sign in _SIGNS):
            raise_if_secured(error, own=own)
        raise


def raise_if_secured(error: Exception, *, own: bool) -> None:
    """Explain an error of rclpy, if security is on.

    Raises:
        SecurityError: It is on.
    """
    settings = security(os.environ, sys.argv)
    if settings is None or not settings.in_force:
        return
    said = str(error).partition(", at /")[0].partition(", at rmw")[0].rstrip(".")
    where = ""
    if own:
        where = f" It is enclave {settings.enclave!r} of the keystore {settings.keystore!r}."
        where += f" {settings.problem()}" if settings.problem() else ""
    raise SecurityError(
        f"ROS security keeps this process out: {said}.{where} `actionkit doctor` checks the"
        " settings and the files. A program chooses its enclave with --ros-args --enclave NAME, or"
        " ROS_SECURITY_ENCLAVE_OVERRIDE; its policy must allow the action."
    ) from error


def enclave(*, own: bool) -> str:
    """Return the enclave where security is on; "" else, or where the context is the user's."""
    settings = security(os.environ, sys.argv)
    return settings.enclave if own and settings is not None and settings.in_force else ""

"""Gets the packages of PyPI that rosbridge imports."""

from __future__ import annotations

import subprocess
import sys
from functools import cache
from pathlib import Path

from tests.field.sources import Missing, built

_PACKAGES = ("tornado", "pymongo", "pillow")
"""The last two are for compressed messages. Nothing here sends any, but rosbridge imports both."""


@cache
def packages() -> Path:
    """Return the folder for `sys.path` that has the packages. Nothing else finds them.

    Raises:
        Missing: pip cannot get them.
    """
    return built(f"rosbridge-{sys.implementation.cache_tag}", _install, Path(__file__))


def _install(folder: Path) -> None:
    command = [sys.executable, "-m", "pip", "install", "--quiet", "--retries", "0"]
    command += ["--timeout", "10", "--target", str(folder), *_PACKAGES]
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    if done.returncode:
        raise Missing(f"rosbridge needs {', '.join(_PACKAGES)}: {done.stderr}")

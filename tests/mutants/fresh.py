"""A plugin for pytest: tests meet the mutant, not what was made before.

mutmut forks the process that has run all tests once. So what `functools.cache` keeps there, and
what modules of tests have made when they were imported, comes from the code without a mutant. And
only the first test that calls a cached function would count as one that calls it.
"""

from __future__ import annotations

import functools
import sys
from pathlib import Path

import pytest


def pytest_load_initial_conftests() -> None:
    """Have the modules of tests imported again."""
    for name, module in list(sys.modules.items()):
        file = Path(getattr(module, "__file__", None) or "/")
        if file.name.startswith("test_") and file.is_relative_to(Path.cwd()):
            del sys.modules[name]
    _forget()


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup() -> None:
    """Empty the caches before each test."""
    _forget()


def _forget() -> None:
    for name, module in list(sys.modules.items()):
        if name.startswith("actionkit."):
            for found in list(vars(module).values()):
                if isinstance(found, functools._lru_cache_wrapper):
                    found.cache_clear()

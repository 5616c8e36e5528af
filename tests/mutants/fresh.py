"""A plugin for pytest: tests meet the mutant, not what was made before.

mutmut forks the process that has run all tests once. So what `functools.cache` keeps there, and
what modules of tests have made when they were imported, comes from the code without a mutant.
"""

from __future__ import annotations

import functools
import gc
import sys
from collections.abc import Iterator
from pathlib import Path


def pytest_load_initial_conftests() -> None:
    """Forget both."""
    for function in _caches():
        function.cache_clear()
    for name, module in list(sys.modules.items()):
        file = Path(getattr(module, "__file__", None) or "/")
        if file.name.startswith("test_") and file.is_relative_to(Path.cwd()):
            del sys.modules[name]


def _caches() -> Iterator[functools._lru_cache_wrapper[object]]:
    for found in gc.get_objects():
        if isinstance(found, functools._lru_cache_wrapper):
            module = getattr(found, "__module__", "") or ""
            if module.startswith("actionkit."):
                yield found

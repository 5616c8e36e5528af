# Made by `actionkit stubs`, which overwrites it.
# fmt: off
# ruff: noqa

from typing import Any as _Any

def __getattr__(name: str) -> _Any: ...  # pyright: ignore[reportIncompleteStub]

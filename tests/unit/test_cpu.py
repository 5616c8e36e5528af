"""A tier that costs too much CPU time fails the run of `.ci/run`."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from tests import cpu, forked


@pytest.mark.parametrize(
    ("budget", "held", "ends"), [(0.0, True, 1), (0.0, False, 0), (1e9, True, 0)]
)
def test_over_budget(budget: float, held: bool, ends: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(forked, "close", lambda: None)
    monkeypatch.setattr(cpu, "BUDGETS", {"default": 1e9, "long": budget})
    options = {"hold_budgets": held, "long": True}
    config: Any = SimpleNamespace(getoption=options.get)
    plugin = cpu.Cpu(config)
    for tier in ("default", "long"):
        plugin.pytest_runtest_logreport(
            SimpleNamespace(  # type: ignore[arg-type]
                nodeid=f"tests/unit/{tier}", duration=2.0, user_properties=[("cpu", (tier, 1.0))]
            )
        )
    session: Any = SimpleNamespace(config=SimpleNamespace(), exitstatus=0)
    plugin.pytest_sessionfinish(session)
    assert session.exitstatus == ends
    lines = plugin.lines()
    assert any(line.split()[:4] == ["long", "1.0", "2.0", "1"] for line in lines)
    assert ("OVER" in lines[-1]) == bool(ends)

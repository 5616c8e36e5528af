"""Sums up the CPU time of a run by tier and folder, and fails a run that is over its budget.

Time on the clock says little on a machine that others use, too. CPU time is what a test costs.
"""

from __future__ import annotations

import json
import os
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from tests import forked

BUDGETS = {"default": 330.0, "long": 1600.0}
"""Seconds of CPU for a run with all tests of a tier; `long` includes the default tier."""
MARGIN = 4 / 3
"""Of a budget: the same work costs more CPU while others use the machine."""
_PROPERTY = "cpu"


def used() -> float:
    """Return the CPU seconds of this process, and of its children that have ended."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


@dataclass
class _Test:
    tier: str
    cpu: float = 0.0
    wall: float = 0.0


class Cpu:
    """The plugin. It measures where tests run, and adds up in the process that pytest started."""

    def __init__(self, config: pytest.Config) -> None:
        self._config = config
        self._since = 0.0
        self._tests: dict[str, _Test] = {}

    # -- where tests run ---------------------------------------------------------------------

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtestloop(self) -> None:
        self._since = used()

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(self, item: pytest.Item, call: pytest.CallInfo[Any]) -> Any:
        report = yield
        if call.when == "teardown":  # all since the last test, so fixtures of modules count
            now = used()
            tier = "long" if item.get_closest_marker("long") else "default"
            report.user_properties.append((_PROPERTY, (tier, now - self._since)))
            self._since = now
        return report

    @pytest.hookimpl(trylast=True)  # when the processes of pytest-xdist have ended
    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        forked.close()
        if hasattr(session.config, "workerinput"):
            return
        if self._config.getoption("hold_budgets") and self._over() and not session.exitstatus:
            session.exitstatus = pytest.ExitCode.TESTS_FAILED

    # -- where it is added up ----------------------------------------------------------------

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        test = self._tests.setdefault(report.nodeid, _Test("default"))
        test.wall += report.duration
        for name, value in report.user_properties:
            if name == _PROPERTY:
                test.tier = value[0]
                test.cpu += value[1]

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        if self._config.getoption("cpu_table"):
            rows = [{"test": name, **vars(test)} for name, test in self._tests.items()]
            Path(self._config.getoption("cpu_table")).write_text(json.dumps(rows, indent=0))
        if len(self._tests) < 50:  # a part of the suite, of which no budget is
            return
        terminalreporter.section("CPU time")
        for line in self.lines():
            terminalreporter.write_line(line)

    def _over(self) -> dict[str, float]:
        """Return the tiers that cost too much."""
        costs = self._costs()
        return {tier: cost for tier, cost in costs.items() if cost > BUDGETS[tier] * MARGIN}

    def _costs(self) -> dict[str, float]:
        """Return what each tier of this run costs: its tests, and its share of what is around."""
        default = sum(test.cpu for test in self._tests.values() if test.tier == "default")
        tests = sum(test.cpu for test in self._tests.values())
        everything = used()
        costs = {"default": everything * default / (tests or 1.0)}
        if self._config.getoption("long"):
            costs["long"] = everything
        return costs

    def lines(self) -> list[str]:
        rows: dict[tuple[str, str], list[_Test]] = defaultdict(list)
        for name, test in self._tests.items():
            folder = "/".join(name.split("::")[0].split("/")[:2])
            rows[test.tier, folder].append(test)
        lines = [f"{'tier':<8}{'CPU s':>8}{'wall s':>8}{'tests':>7}  folder"]
        for (tier, folder), tests in sorted(
            rows.items(), key=lambda row: (row[0][0], -sum(test.cpu for test in row[1]))
        ):
            cpu, wall = sum(test.cpu for test in tests), sum(test.wall for test in tests)
            lines.append(f"{tier:<8}{cpu:8.1f}{wall:8.1f}{len(tests):7}  {folder}")
        around = used() - sum(test.cpu for test in self._tests.values())
        lines.append(f"{'':<8}{around:8.1f}                around the tests")
        for tier, cost in self._costs().items():
            # A first run compiles everything, too, and fails for no budget.
            over = self._config.getoption("hold_budgets") and tier in self._over()
            told = ", MORE THAN A THIRD OVER IT" if over else ""
            lines.append(f"{tier} tier: {cost:.0f} s of CPU, budget {BUDGETS[tier]:.0f} s{told}")
        return lines

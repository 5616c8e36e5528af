"""docs/testing.md is true: its mission's tests run, and are short."""

from __future__ import annotations

import inspect
import re
from pathlib import Path

from actionkit.testing import FakeServer
from actionkit.testing._fake_notes import EVENTS
from tests.fake_server.test_fake_server_in_pytest import run_pytest

TEXT = (Path(__file__).resolve().parent.parent / "docs" / "testing.md").read_text()
FILES = dict(re.findall(r"^```python\n# (\w+\.py)\n(.*?)^```$", TEXT, re.M | re.S))


def test_its_files_run(tmp_path: Path) -> None:
    assert set(FILES) == {"mission.py", "test_mission.py", "test_steps.py"}
    for name, source in FILES.items():
        (tmp_path / name).write_text(source)
    done = run_pytest(tmp_path, "", "-p", "no:xdist", "--asyncio-mode=strict")
    assert "6 passed" in done.stdout, done.stdout + done.stderr


def test_the_tests_of_the_mission_are_short() -> None:
    code = [line for line in FILES["test_mission.py"].splitlines() if line.strip()]
    assert len(code) < 40


def test_its_settings_and_events_are_all_there_are() -> None:
    rows = re.findall(r"^\| `(\w+)` \| `(.*?)` \|", TEXT, re.M)
    parameters = inspect.signature(FakeServer.__init__).parameters
    known = {
        name: repr(parameter.default).replace("'", '"')
        for name, parameter in parameters.items()
        if parameter.kind is parameter.KEYWORD_ONLY and name != "domain_id"
    }
    assert dict(rows) == known
    missing = [event for event in EVENTS if f"`{event}`" not in TEXT]
    assert missing == []

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

IN_ONE_DOMAIN = """
import rclpy
from test_msgs.action import Fibonacci
from actionkit import Client

def test_all_in_one_domain(fake_server, ros_domain):
    assert rclpy.get_default_context().get_domain_id() == ros_domain
    fake_server(Fibonacci, "pick", result={"sequence": [42]})
    with Client(Fibonacci, "pick") as client:
        assert list(client.call({}, timeout=30.0).sequence) == [42]
"""


def test_its_files_run(tmp_path: Path) -> None:
    tests = {"test_mission.py", "test_steps.py", "test_with_a_node.py"}
    assert set(FILES) == tests | {"mission.py", "conftest.py"}
    last = tmp_path / "z_last"  # ROS stays initialised there
    last.mkdir()
    (last / "test_it.py").write_text(IN_ONE_DOMAIN)
    for name, source in FILES.items():
        ((last if name == "conftest.py" else tmp_path) / name).write_text(source)
    done = run_pytest(tmp_path, "", "-p", "no:xdist", "--asyncio-mode=strict")
    assert "8 passed" in done.stdout, done.stdout + done.stderr


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

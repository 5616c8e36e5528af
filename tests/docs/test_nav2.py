"""The page on Nav2's NavigateToPose runs, on its real type and a server that stands in for Nav2."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests import forked
from tests.docs.snippets import run_page
from tests.docs.test_pages import DOCS

HERE = Path(__file__).parent


@pytest.mark.heavy
@pytest.mark.long
def test_the_page(ros_domain: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    built = tmp_path / "built"
    build = [sys.executable, "-m", "actionkit", "interfaces", "build", str(HERE / "nav2_msgs")]
    env = {**os.environ, "CFLAGS": "-O0", "CXXFLAGS": "-O0"}
    done = forked.run(
        [*build, "-o", str(built)], env=env, capture_output=True, text=True, check=False
    )
    if "C++ compiler" in done.stderr:
        pytest.skip("there is no C++ compiler")
    assert done.returncode == 0, done.stderr
    monkeypatch.setenv("PYTHONPATH", str(built))
    with forked.Popen(
        [sys.executable, str(HERE / "nav2_server.py")],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as server:
        assert server.stdout is not None
        assert any("ready" in line for line in server.stdout)
        run_page(DOCS / "guides" / "nav2.md", tmp_path)
        assert server.stdin is not None
        server.stdin.close()
        assert server.wait(20) == 0

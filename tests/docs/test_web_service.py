"""The web service of the page on asyncio stops the robot when its client is gone."""

from __future__ import annotations

import http.client
import json
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import pytest

from tests.docs.snippets import blocks
from tests.docs.test_pages import DOCS

pytest.importorskip("uvicorn", reason="the service needs starlette and uvicorn")


@contextmanager
def _service(folder: Path) -> Iterator[tuple[int, subprocess.Popen[str]]]:
    """Run it, and yield its port and process."""
    (text,) = [
        b.text for b in blocks(DOCS / "guides" / "asyncio.md") if b.mark == "file: service.py"
    ]
    (folder / "service.py").write_text(text)
    words = [sys.executable, "-m", "uvicorn", "service:app", "--port", "0", "--no-use-colors"]
    with subprocess.Popen(words, cwd=folder, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        try:
            line = next(line for line in process.stderr if "running on" in line)
            yield int(line.split("127.0.0.1:")[1].split()[0]), process
        finally:
            process.terminate()
            process.stderr.read()


def _ask(port: int, order: object) -> http.client.HTTPConnection:
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=30)
    connection.request("POST", "/drive", json.dumps({"order": order}))
    return connection


@pytest.mark.long
def test_the_service(action_server: Any, tmp_path: Path) -> None:
    server = action_server("fibonacci", period=0.1)
    with _service(tmp_path) as (port, _):
        with closing(_ask(port, 3)) as connection:
            assert json.load(connection.getresponse()) == {"sequence": [0, 1, 1, 2]}
        with closing(_ask(port, "three")) as connection:
            assert json.load(connection.getresponse())["error"] == "InvalidGoalError"

        gone = _ask(port, 100)
        goal_id = server.wait_for("accepted", count=2)[-1].goal_id
        gone.close()
        server.wait_for("canceled", goal_id=goal_id)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.long
def test_the_service_is_told_to_end(
    number: signal.Signals, action_server: Any, tmp_path: Path
) -> None:
    server = action_server("fibonacci", period=0.1)
    with _service(tmp_path) as (port, process), closing(_ask(port, 100)) as connection:
        goal_id = server.wait_for("accepted")[0].goal_id
        process.send_signal(number)
        server.wait_for("canceled", goal_id=goal_id)  # while the connection is open
        assert json.load(connection.getresponse()) == {"error": "Cancelled"}
        assert process.wait(20) in (0, -number)

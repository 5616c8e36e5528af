"""docs/hosts.md has a row for each host; `python -m tests.hosts --write-docs` writes them."""

from __future__ import annotations

import json
import subprocess
import sys

from tests.hosts.__main__ import DRIVERS, HOSTS, PAGE, row_key


def test_the_page_has_all_hosts() -> None:
    table = PAGE.read_text("utf-8").partition("<!-- table: hosts -->")[2].partition("<!-- end")[0]
    rows = {row_key(line) for line in table.splitlines() if line.startswith("|")}
    assert {(host.title, transport) for host in HOSTS for transport in ("stdio", "HTTP")} <= rows


def test_a_host_that_is_not_installed_is_told_of() -> None:
    words = [
        sys.executable,
        str(DRIVERS),
        "openai-agents",
        "tools",
        json.dumps({"url": "http://x"}),
    ]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode
    assert done.stderr.splitlines()[-1] == "ModuleNotFoundError: No module named 'agents'"

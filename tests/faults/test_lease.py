"""The shorter lease of docs/guides/deployment.md works as written there."""

from __future__ import annotations

import re
import time
from pathlib import Path

from actionkit import GoalState, RetryPolicy, servers

_PAGE = Path(__file__).parents[2] / "docs" / "guides" / "deployment.md"
_DEFAULT_LEASE = 20.0
"""Seconds; a server that was killed right after it announced itself is gone 3 s sooner."""


def test_a_shorter_lease(make_client, ros_domain, tmp_path, monkeypatch):
    (profile,) = re.findall(r"```xml\n(.*?)```", _PAGE.read_text(), re.DOTALL)
    file = tmp_path / "lease.xml"
    file.write_text(profile)
    with monkeypatch.context() as environment:
        environment.setenv("FASTRTPS_DEFAULT_PROFILES_FILE", str(file))
        server = servers.start("never_finishes", domain_id=ros_domain)
    with server:
        future = make_client(retry=RetryPolicy.none()).call_async({"order": 1})
        server.wait_for("executing")
        began = time.monotonic()
        server.kill()
        assert future.outcome(_DEFAULT_LEASE / 2).status is GoalState.LOST
        assert time.monotonic() - began > 1.0  # by the lease, and by nothing else

"""docs/logging.md is true: its tables are those of the code, its snippets run."""

from __future__ import annotations

import json
import logging
import os
import re
import sys
import uuid
from pathlib import Path

from actionkit import (
    CallInfo,
    CancelReport,
    GoalAbortedError,
    GoalEvent,
    GoalState,
    Outcome,
    Timeline,
)
from actionkit._observers.goal_log import GoalLog
from actionkit._observers.json_schema import event_line, outcome_line
from actionkit._observers.words import LEVELS
from tests import forked

TEXT = (Path(__file__).resolve().parent.parent / "docs" / "logging.md").read_text()
ID = uuid.UUID(int=1)
CALL = CallInfo(ID, "/fibonacci", "test_msgs/action/Fibonacci", "", 0.0, 0.0)
EVENT = GoalEvent(ID, 1, GoalState.SENDING, 1.0, 1.0)
OUTCOME = Outcome(
    GoalState.ABORTED, None, GoalAbortedError("no"), 1, Timeline(), ID, CancelReport.CONFIRMED
)


def table(heading: str) -> list[list[str]]:
    """The cells of the table that has this as its first heading, without their backquotes."""
    found = re.search(rf"^\| {re.escape(heading)} \|.*\n\|[-|]+\n((?:\|.*\n)+)", TEXT, re.M)
    assert found, heading
    return [[cell.strip() for cell in row.split("|")[1:-1]] for row in found[1].splitlines()]


def words(cell: str) -> set[str]:
    return set(re.findall(r"`(\w+)`", cell))


def test_the_levels() -> None:
    told = {row[0].strip("`"): row[1].upper() for row in table("state")}
    assert told == {state.value: logging.getLevelName(level) for state, level in LEVELS.items()}


def test_the_fields_of_the_log() -> None:
    told = {word for row in table("field") for word in words(row[0])}
    kept: list[logging.LogRecord] = []
    handler = logging.Handler()
    handler.emit = kept.append  # type: ignore[method-assign]
    logger = logging.getLogger("actionkit.goal")
    logger.addHandler(handler)
    try:
        GoalLog().on_outcome(OUTCOME, CALL)
    finally:
        logger.removeHandler(handler)
    plain = set(vars(logging.makeLogRecord({}))) | {"message", "asctime", "taskName"}
    assert told == set(vars(kept[0])) - plain


def test_the_schema() -> None:
    start = TEXT.index("Version 1 of the schema")
    rows = re.findall(r"^\| (.+?) \| (both|event|outcome) \| .*\|$", TEXT[start:], re.M)
    told: dict[str, set[str]] = {"event": set(), "outcome": set()}
    for cell, where in rows:
        for kind in told if where == "both" else [where]:
            told[kind] |= words(cell)
    assert told["event"] == set(json.loads(event_line(EVENT, CALL, goal={}, feedback={})))
    assert told["outcome"] == set(json.loads(outcome_line(OUTCOME, CALL, {})))


def test_the_snippets_run(action_server, tmp_path: Path) -> None:
    action_server("fibonacci", period=0.02)
    blocks = re.findall(r"^```python\n(.*?)^```$", TEXT, re.M | re.S)
    assert len(blocks) >= 6
    done = forked.run(
        [sys.executable, "-c", "\n".join(blocks)],
        cwd=tmp_path,
        env=os.environ | {"RCUTILS_LOGGING_USE_STDOUT": "1"},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "SUCCEEDED" in done.stdout
    assert (tmp_path / "goals.jsonl").exists()

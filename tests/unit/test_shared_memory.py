"""After a process was killed, its shared memory does not stop other processes."""

from __future__ import annotations

import os
import time
from pathlib import Path

from tests.shared_memory import mend


def test_a_port_that_was_left_empty_is_marked_and_nothing_else(tmp_path: Path) -> None:
    left, young, lock, whole = (
        tmp_path / f"fastrtps_port{name}" for name in ("7008", "7009", "7008_el", "7010")
    )
    for path in (left, young, lock, whole):
        path.write_bytes(b"1" if path is whole else b"")
    for path in (left, lock, whole):
        os.utime(path, (time.time() - 60,) * 2)
    assert mend(tmp_path) == [left.name]
    assert left.read_bytes()[:4] == b"\3\0\0\0"
    assert (young.read_bytes(), lock.read_bytes(), whole.read_bytes()) == (b"", b"", b"1")
    assert mend(tmp_path) == []

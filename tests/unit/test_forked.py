"""Programs that tests fork behave as in interpreters of their own."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

from tests import forked


def test_exit_codes_of_programs_that_threads_start() -> None:
    """Of two kinds: each has a process of its own that forks."""

    def code(kind: str) -> int:
        return forked.run([sys.executable, "-c", "raise SystemExit(7)", kind]).returncode

    with ThreadPoolExecutor(2) as threads:
        assert set(threads.map(code, ["plain", "mcp"] * 10)) == {7}


def test_it_is_itself_when_its_id_is_known() -> None:
    command = [sys.executable, "-c", "import signal; signal.pause()"]
    with forked.Popen(command, start_new_session=True) as process:
        assert os.getpgid(process.pid) == os.getsid(process.pid) == process.pid
        os.killpg(process.pid, signal.SIGKILL)
    assert process.returncode == -signal.SIGKILL


def test_no_future_import_of_ours_is_in_force() -> None:
    program = "def annotated(value: Missing) -> None: ..."
    done = forked.run([sys.executable, "-c", program], stderr=subprocess.PIPE, text=True)
    assert "NameError" in done.stderr


def test_what_is_written_unbuffered_is_there_when_it_is_killed() -> None:
    program = "import os, sys; sys.stdout.write('text'); os.kill(os.getpid(), 9)"
    done = forked.run([sys.executable, "-u", "-c", program], stdout=subprocess.PIPE, text=True)
    assert (done.returncode, done.stdout) == (-9, "text")

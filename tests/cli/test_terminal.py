"""The command line on a terminal: what is drawn, Ctrl-C as a person presses it, a closed window."""

from __future__ import annotations

import contextlib
import os
import pty
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass

import pytest

from actionkit.cli._exits import Exit
from tests.cli.conftest import FIBONACCI, NESTED, World, compare
from tests.conftest import without_noise

from .test_call import masked, shell

CTRL_C = b"\x03"
SHOW_CURSOR = "\x1b[?25h"
# The terminal becomes the controlling one, so that its keys and its end are signals.
IN_TERMINAL = (
    "import fcntl, os, sys, termios; os.setsid(); fcntl.ioctl(0, termios.TIOCSCTTY, 0);"
    "os.execv(sys.executable, [sys.executable, '-m', 'actionkit', *sys.argv[1:]])"
)


@dataclass
class Terminal:
    """A terminal with the command line in it."""

    process: subprocess.Popen[bytes]
    master: int
    raw: str = ""

    @property
    def text(self) -> str:
        """What was written, without the codes for colours and places, and by Fast DDS."""
        return without_noise(re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", self.raw))

    def until(self, words: str) -> None:
        """Read until the words come; the test's time limit bounds the wait."""
        while words not in self.text:
            chunk = os.read(self.master, 65536)
            self.raw += chunk.decode(errors="replace")

    def press(self, keys: bytes) -> None:
        os.write(self.master, keys)

    def finish(self) -> int:
        """Read the rest; return the exit code."""
        with contextlib.suppress(OSError):  # how Linux tells that the last user left
            while chunk := os.read(self.master, 65536):
                self.raw += chunk.decode(errors="replace")
        return self.process.wait(20)


@pytest.fixture
def terminal(world: World) -> Iterator[object]:
    """Open terminals."""
    opened: list[Terminal] = []

    def start(*words: str) -> Terminal:
        master, slave = pty.openpty()
        process = subprocess.Popen(
            [sys.executable, "-c", IN_TERMINAL, *words],
            stdin=slave,
            stdout=slave,
            stderr=slave,
            env=world.environment,
        )
        os.close(slave)
        opened.append(Terminal(process, master))
        return opened[-1]

    yield start
    for one in opened:
        with contextlib.suppress(OSError):
            os.close(one.master)
        if one.process.poll() is None:
            one.process.kill()
            one.process.wait()


def test_a_bar_grows_where_feedback_tells_the_share(world, terminal) -> None:
    world.server("navigate")
    words = (
        "call", "/navigate", NESTED, "{nested_field: {float64_value: 0.9}}",
        "--progress", "nested_field.float32_value",
    )  # fmt: skip
    shown = terminal(*words)
    assert shown.finish() == Exit.OK, shown.text
    shares = [int(share) for share in re.findall(r"(\d+)%, \d+ feedback", shown.text)]
    assert len(set(shares)) > 3
    assert shares == sorted(shares)
    assert shown.raw.rindex(SHOW_CURSOR) > shown.raw.rindex("%")
    # What is left on the screen is what `ros2 action send_goal` leaves there.
    assert shown.text.replace("\r", "").endswith("Goal finished with status: SUCCEEDED\n")

    frames = masked(f"$ {shell(list(words))}\n" + drawn(shown.text))
    compare("call-terminal", frames, shape)


def drawn(text: str) -> str:
    """Return every line that was on the screen, those too that others were drawn over.

    But for the line below while there is no feedback: how long that is depends on discovery.
    """
    lines = [line.rstrip() for line in re.split(r"\r\n|\n|\r", text)]
    lines = [line for line in lines if not re.match(r"━+( 0 feedback.*)?$", line)]
    kept = [line for n, line in enumerate(lines) if line and (n == 0 or line != lines[n - 1])]
    return "\n".join(kept) + "\n"


def shape(text: str) -> list[str]:
    """Leave out how often the line was drawn, and what was in it by then."""
    lines = [re.sub(r"^[━╸╺]+.*", "(the bar)", line) for line in text.splitlines()]
    return [line for n, line in enumerate(lines) if line != "(the bar)" or lines[n - 1] != line]


def test_without_a_share_there_are_counters_and_the_time(world, terminal) -> None:
    world.server("countdown", period=0.05)
    shown = terminal("call", "countdown", FIBONACCI, "{order: 8}")
    assert shown.finish() == Exit.OK, shown.text
    counts = [int(count) for count in re.findall(r"(\d+) feedback messages?, [\d.]+ s", shown.text)]
    assert counts[-1] > counts[0]
    assert "%" not in shown.text


def test_ctrl_c_cancels_and_twice_leaves(world, terminal) -> None:
    server = world.server("slow_cancel", gate=1)
    shown = terminal("call", "slow_cancel", FIBONACCI, "{}", "--cancel-timeout", "30")
    shown.until("EXECUTING")
    shown.press(CTRL_C)
    shown.until("Canceling goal... (Ctrl-C; once more leaves at once)")
    server.wait_for("cancel_accepted")
    # The drawing goes on while the server takes its time.
    shown.until("CANCELING")
    shown.press(CTRL_C)
    assert shown.finish() == Exit.INTERRUPTED
    assert "MAY STILL BE RUNNING" in shown.text
    assert shown.raw.rindex(SHOW_CURSOR) > shown.raw.rindex("CANCELING")
    server.release(1)


def test_a_closed_window_cancels_the_goal(world, terminal) -> None:
    server = world.server("never_finishes")
    shown = terminal("call", "never_finishes", FIBONACCI)
    shown.until("EXECUTING")
    os.close(shown.master)
    assert shown.process.wait(20) == Exit.HANGUP
    server.wait_for("canceled")
    assert server.running() == set()


def test_watch_draws_a_table(world, terminal) -> None:
    server = world.server("never_finishes")
    shown = terminal("watch", "never_finishes")
    shown.until("/reference_server")
    call = world.start("call", "never_finishes", FIBONACCI)
    call.until("Goal accepted")
    shown.until("EXECUTING")
    assert "1 EXECUTING" in shown.text
    shown.press(CTRL_C)
    assert shown.finish() == Exit.INTERRUPTED
    assert shown.raw.rstrip().endswith("Interrupted.")
    assert "Traceback" not in shown.text
    assert server.running()  # watching touches nothing

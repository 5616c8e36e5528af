"""The command line on a terminal: its output, Ctrl-C by a person, a closed window."""

from __future__ import annotations

import contextlib
import html
import io
import os
import pty
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass

import pytest
from rich.console import Console
from rich.text import Text

from actionkit.cli._shared.exits import Exit
from tests.cli.conftest import FIBONACCI, NESTED, World, compare, without_numbers
from tests.conftest import without_noise

from .test_call import shell

CTRL_C = b"\x03"
BAR = "━"
CODES_BUT_COLOURS = r"\x1b\[[\d;?]*[A-Za-ln-z]"
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

    def press_until_it_ends(self, keys: bytes) -> None:
        """Press again and again: two presses within 0.1 s count as one."""
        while self.process.poll() is None:
            self.press(keys)
            with contextlib.suppress(subprocess.TimeoutExpired):
                self.process.wait(0.2)

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

    def start(*words: str, **environment: str) -> Terminal:
        master, slave = pty.openpty()
        process = subprocess.Popen(
            [sys.executable, "-c", IN_TERMINAL, *words],
            stdin=slave,
            stdout=slave,
            stderr=slave,
            env=world.environment | environment,
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


@pytest.mark.long
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


@pytest.mark.long
def test_what_a_terminal_shows_is_the_picture_in_the_readme(world, terminal) -> None:
    world.server("fibonacci", period=0.25)
    words = ("call", "/fibonacci", FIBONACCI, "{order: 6}", "--progress", "sequence:7")
    shown = terminal(*words, TERM="xterm-256color")
    assert shown.finish() == Exit.OK, shown.text
    lines = [f"\x1b[1m$ {shell(list(words))}\x1b[0m", *drawn(without_noise(shown.raw))]
    compare("call-terminal.svg", picture("\n".join(lines)), shape)


def drawn(raw: str) -> list[str]:
    """Return every line that was on the screen, with its colours; the bar once for each feedback.

    Except the bar while there is no feedback: how often that is drawn depends on discovery.
    """
    last: dict[object, str] = {}
    for n, line in enumerate(re.split(r"\r\n|\n|\r", re.sub(CODES_BUT_COLOURS, "", raw))):
        count = re.search(r"(\d+) feedback", line)
        if count is None and BAR not in line:
            last[n] = line
        elif count is not None and count[1] != "0":
            last[count[0]] = line
    return list(last.values())


def picture(text: str) -> str:
    """Draw a text with colours as an SVG that loads nothing."""
    lines = Text.from_ansi(text)
    console = Console(
        record=True, file=io.StringIO(), width=max(map(len, lines.plain.splitlines()))
    )
    console.print(lines, soft_wrap=True)
    svg = console.export_svg(title="actionkit call", unique_id="terminal")
    return re.sub(r"@font-face \{.*?\}\s*", "", svg, flags=re.S)


def shape(svg: str) -> list[object]:
    """Return the lines of a picture; but not how often the bar was drawn, and what was in it."""
    rows: dict[str, str] = {}
    for y, text in re.findall(r'<text[^>]* y="([\d.]+)"[^>]*>([^<]*)</text>', svg):
        rows[y] = rows.get(y, "") + html.unescape(text).replace("\xa0", " ").rstrip("\n")
    lines = ["(the bar)" if BAR in line else line.rstrip() for line in rows.values()]
    bar_once = [line for n, line in enumerate(lines) if line != "(the bar)" or lines[n - 1] != line]
    return [without_numbers(line) for line in bar_once]


@pytest.mark.long
def test_without_a_share_there_are_counters_and_the_time(world, terminal) -> None:
    world.server("countdown", period=0.05)
    shown = terminal("call", "countdown", FIBONACCI, "{order: 8}")
    assert shown.finish() == Exit.OK, shown.text
    counts = [int(count) for count in re.findall(r"(\d+) feedback messages?, [\d.]+ s", shown.text)]
    assert counts[-1] > counts[0]
    assert "%" not in shown.text


def test_ctrl_c_cancels_and_twice_leaves(world, terminal) -> None:
    server = world.server("slow_cancel", gate=1)
    shown = terminal("call", "slow_cancel", FIBONACCI, "{}", "--cancel-timeout", "15")
    shown.until("EXECUTING")
    shown.press(CTRL_C)
    shown.until("Canceling goal... (Ctrl-C; once more leaves at once)")
    server.wait_for("cancel_accepted")
    # The drawing goes on while the server takes its time.
    shown.until("CANCELING")
    shown.press_until_it_ends(CTRL_C)
    assert shown.finish() == Exit.INTERRUPTED
    assert "Left at once. Goal" in shown.text
    assert "MAY STILL BE RUNNING" in shown.text
    assert shown.raw.rindex(SHOW_CURSOR) > shown.raw.rindex("CANCELING")
    server.release(1)


@pytest.mark.long
def test_a_closed_window_cancels_the_goal(world, terminal) -> None:
    server = world.server("never_finishes")
    shown = terminal("call", "never_finishes", FIBONACCI)
    shown.until("EXECUTING")
    os.close(shown.master)
    assert shown.process.wait(20) == Exit.HANGUP
    server.wait_for("canceled")
    assert server.running() == set()


@pytest.mark.long
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


@pytest.mark.long
def test_watch_draws_a_table_of_all_actions(world, terminal) -> None:
    world.server("never_finishes")
    shown = terminal("watch")
    shown.until("in sight")
    call = world.start("call", "never_finishes", FIBONACCI)
    call.until("Goal accepted")
    shown.until("/never_finishes")
    shown.until("EXECUTING")
    shown.until("last change  server")
    assert re.search(r"/never_finishes +[0-9a-f]{8} +EXECUTING +[\d.]+ s +[\d.]+ s ago", shown.text)
    shown.press(CTRL_C)
    assert shown.finish() == Exit.INTERRUPTED

"""`actionkit demo`, and the command line around it, run as users run them. Contract C6.3."""

from __future__ import annotations

import contextlib
import os
import pty
import re
import signal
import subprocess
import sys
import time

import pytest

from tests import forked

TITLES = (
    "1. A call that waits",
    "2. Two goals at once",
    "3. Cancelling a goal",
    "4. A goal that the server rejects",
    "5. A deadline",
    "6. No server",
)
PATIENCE = 60.0


def run(*words: str, program: str = "") -> subprocess.CompletedProcess[str]:
    """Run the command line; `program` is code to run before it, in the same process."""
    code = f"{program}\nfrom actionkit.cli import main; main()"
    return forked.run(
        [sys.executable, "-c", code, *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        stdin=subprocess.DEVNULL,
        text=True,
        timeout=PATIENCE,
        check=False,
    )


def server_pid(output: str) -> int:
    found = re.search(r"runs as another process\s+\((\d+)\)", output)
    assert found, output
    return int(found[1])


def assert_gone(pid: int) -> None:
    with pytest.raises(ProcessLookupError):
        os.kill(pid, 0)


@pytest.mark.heavy
def test_every_step_comes_out_as_it_should() -> None:
    began = time.monotonic()
    done = run("demo")
    took = time.monotonic() - began
    assert done.returncode == 0, done.stdout
    places = [done.stdout.index(title) for title in TITLES]
    assert places == sorted(places)
    told = " ".join(done.stdout.split())
    for wanted in (
        "on this machine only",
        "10 of 10 newest number: 55",
        "-> [0, 1, 1, 2, 3, 5, 8, 13, 21, 34, 55]",
        "-> [0, 1, 1, 2, 3, 5] -> [0, 1, 1, 2, 3, 5, 8, 13, 21]",
        "-> server confirms: CANCELED The server's own journal: accepted at",
        "was rejected by the server",
        "-> cancel: CONFIRMED The server's own journal: accepted at",
        "Served under a similar name: '/fibonacci'",
    ):
        assert wanted in told
    assert done.stdout.splitlines()[-1].startswith("All 6 steps came out as they should, in")
    assert "FAILED" not in done.stdout
    # About ten seconds; twice that on a machine with much else to do
    assert took < 20
    assert_gone(server_pid(done.stdout))


@pytest.mark.heavy
@pytest.mark.long
def test_on_a_terminal_there_is_a_progress_bar() -> None:
    master, slave = pty.openpty()
    environment = {**os.environ, "TERM": "xterm", "COLUMNS": "100"}
    with forked.Popen(
        [sys.executable, "-m", "actionkit", "demo"],
        stdin=slave, stdout=slave, stderr=slave, env=environment,
    ) as process:  # fmt: skip
        os.close(slave)
        output = b""
        with contextlib.suppress(OSError):  # how Linux tells that a terminal's last user left
            while chunk := os.read(master, 65536):
                output += chunk
        os.close(master)
        assert process.wait(PATIENCE) == 0
    text = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", output.decode())
    assert "newest number: 55" in text
    assert "\r" in text.replace("\r\n", "")  # a line that is drawn again and again
    assert "All 6 steps came out as they should" in text


@pytest.mark.heavy
@pytest.mark.parametrize(
    "moment",
    [
        "-> feedback:",
        *(
            pytest.param(moment, marks=pytest.mark.long)
            for moment in ("3 of 10", TITLES[1], TITLES[4], TITLES[5])
        ),
    ],
)
@pytest.mark.long
def test_ctrl_c_ends_it_cleanly(moment: str) -> None:
    with forked.Popen(
        [sys.executable, "-u", "-m", "actionkit", "demo"],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,  # as a terminal's foreground group, which Ctrl-C goes to
    ) as process:
        assert process.stdout is not None
        output = ""
        for line in process.stdout:
            output += line
            if moment in line:
                break
        began = time.monotonic()
        os.killpg(process.pid, signal.SIGINT)
        output += process.stdout.read()
        code = process.wait(PATIENCE)
    assert code == 130, output
    assert "Traceback" not in output
    assert output.endswith("Interrupted.\n")
    assert time.monotonic() - began < 8
    assert_gone(server_pid(output))


@pytest.mark.heavy
@pytest.mark.long
def test_it_does_not_say_that_all_is_well_when_it_is_not() -> None:
    # A server that rejects what the demo takes for granted
    program = """
import functools, actionkit.cli.demo.demo as demo
demo.start = functools.partial(demo.start, max_order=6)
"""
    done = run("demo", program=program)
    assert done.returncode == 1, done.stdout
    assert done.stdout.count("FAILED: GoalRejectedError") == 4  # steps 1, 2, 3 and 5
    last = " ".join(done.stdout.split())[-300:]
    assert "FAILED: 4 of 6 steps did not come out right: A call that waits" in last
    assert "Traceback" not in done.stdout


def test_a_server_that_does_not_start_is_told() -> None:
    program = """
import actionkit.cli.demo.demo as demo
def start(*arguments, **options):
    raise RuntimeError("the fibonacci server was not up within 20 s")
demo.start = start
"""
    done = run("demo", program=program)
    assert done.returncode == 1
    assert done.stdout == "  FAILED: the fibonacci server was not up within 20 s\n"


@pytest.mark.parametrize(("width", "most"), [(60, 60), (80, 80)])
def test_texts_and_code_fit_the_terminal(width: int, most: int) -> None:
    import io

    from rich.console import Console

    from actionkit.cli.demo._screen import DemoScreen
    from actionkit.cli.demo._steps import STEPS

    out = io.StringIO()
    screen = DemoScreen(Console(file=out, width=width, highlight=False, markup=False))
    for shown, _ in STEPS:
        screen.text(shown.__doc__ or "")
        screen.code(shown)
    assert most * 0.8 < max(map(len, out.getvalue().splitlines())) <= most


@pytest.mark.long
@pytest.mark.parametrize("module", ["rclpy", "test_msgs"])
def test_without_ros_it_says_what_to_install(module: str) -> None:
    done = run("demo", program=f"import sys; sys.modules[{module!r}] = None")
    assert done.returncode == 3
    told = " ".join(done.stdout.split())
    assert f"{module} cannot be imported" in told
    assert "pip install" in told
    assert "ros-jazzy-" in told.partition("pip install")[2]
    assert "source its setup file" in told
    assert "Traceback" not in done.stdout


@pytest.mark.long
def test_the_command_line_around_it() -> None:
    version = run("--version")
    assert (version.returncode, version.stdout) == (0, "actionkit, version 1.0.0\n")
    for words in (("--help",), ("-h",)):
        shown = run(*words)
        assert shown.returncode == 0
        assert re.search(r"^  demo  ", shown.stdout, re.M)
    wrong = run("demmo")
    assert wrong.returncode == 2
    assert "No such command 'demmo'" in wrong.stdout
    assert run("demo", "--faster").returncode == 2


@pytest.mark.long
def test_a_reader_that_goes_away_is_no_error() -> None:
    command = f"{sys.executable} -m actionkit --help | true; exit ${{PIPESTATUS[0]}}"
    done = subprocess.run(
        ["bash", "-c", command], capture_output=True, text=True, timeout=PATIENCE, check=False
    )
    assert done.returncode in (0, 141)  # 0: it had written before the reader went
    assert done.stderr == ""

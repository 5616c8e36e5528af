"""Shared by tests of the command line: run it as users do, with servers that keep running."""

from __future__ import annotations

import contextlib
import io
import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from actionkit import servers
from actionkit.cli import main
from actionkit.servers import Server
from actionkit.testing import isolated_domain
from tests import forked
from tests.conftest import without_noise

CAPTURES = Path(__file__).parents[2] / "docs" / "captures"
PATIENCE = 40.0
FIBONACCI = "test_msgs/action/Fibonacci"
NESTED = "test_msgs/action/NestedMessage"


def without_numbers(text: str) -> object:
    """Return what is the same in every run: ids, times and the domain differ."""
    text = re.sub(r"^Progress:.*\n", "", text, flags=re.M)  # feedback is sent best effort
    text = re.sub(r"[0-9a-f]{8}(-[0-9a-f]{4}){3}-[0-9a-f]{12}", "ID", text)
    return re.sub(r"\d+(\.\d+)?", "N", text)


def compare(name: str, shown: str, stable: Callable[[str], object] = without_numbers) -> None:
    """Compare what was shown with the capture of that name in docs/captures.

    Args:
        name: The file's.
        shown: What it would be.
        stable: Returns the part of it that is the same in each run.

    With ACTIONKIT_WRITE_CAPTURES=1 in the environment, the capture is written.
    """
    path = CAPTURES / name
    if os.environ.get("ACTIONKIT_WRITE_CAPTURES") == "1":
        path.write_text(shown, "utf-8")
    told = "not what ACTIONKIT_WRITE_CAPTURES=1 wrote"
    assert stable(shown) == stable(path.read_text("utf-8")), told


@dataclass
class Running:
    """The command line in a process of its own, standard output and error in one pipe."""

    process: subprocess.Popen[str]
    text: str = ""

    def until(self, words: str) -> None:
        """Read lines until one has the words; the test's time limit bounds the wait."""
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.text += without_noise(line)
            if words in line:
                return
        raise AssertionError(f"ended without {words!r}:\n{self.text}")

    def signal(self, number: int) -> None:
        """Send a signal, as a terminal does."""
        self.process.send_signal(number)

    def finish(self) -> int:
        """Read the rest; return the exit code."""
        assert self.process.stdout is not None
        self.text += without_noise(self.process.stdout.read())
        return self.process.wait(PATIENCE)


@dataclass
class Done:
    """What a run came to."""

    code: int
    out: str
    err: str


@dataclass
class World:
    """A ROS domain for the tests of a module, with servers that are started once."""

    domain: int
    stack: ExitStack
    cached: dict[str, tuple[dict[str, Any], Server]] = field(default_factory=dict)

    @property
    def environment(self) -> dict[str, str]:
        """What a process needs to be in the domain, and to look the same everywhere."""
        inherited = {
            name: value
            for name, value in os.environ.items()
            if not name.startswith(("ROS_", "COLUMNS", "_ACTIONKIT")) and name != "PYTHONUNBUFFERED"
        }
        return inherited | {
            "ROS_DOMAIN_ID": str(self.domain),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            # On a busy machine a server may come into sight late.
            "ACTIONKIT_CALL_SERVER_TIMEOUT": "30",
            "ACTIONKIT_WATCH_SERVER_TIMEOUT": "30",
            "COLUMNS": "100",
            "TERM": "xterm",
        }

    def server(self, name: str, **options: Any) -> Server:
        """Return the server, on the action of its name; started where it does not run."""
        known, server = self.cached.get(name, (options, None))
        if server is not None and (known != options or not server.alive):
            server.stop()
            server = None
        if server is None:
            server = self.stack.enter_context(
                servers.start(name, action_name=name, domain_id=self.domain, **options)
            )
        self.cached[name] = (options, server)
        return server

    def start(self, *words: str, before: str = "", **options: Any) -> Running:
        """Start the command line; `before` is code to run first, in the same process."""
        code = f"{before}\nfrom actionkit.cli import main; main()"
        process = forked.Popen(
            [sys.executable, "-c", code, *words],
            **{
                "stdin": subprocess.DEVNULL,
                "stdout": subprocess.PIPE,
                "stderr": subprocess.STDOUT,
                "text": True,
                "env": self.environment,
                **options,
            },
        )
        self.stack.callback(_end, process)
        return Running(process)

    def run(self, *words: str) -> Done:
        """Run the command line to its end in the test's process, which is cheaper than its own.

        Not for `stop` and `serve`, which change how their process hears signals and speaks DDS, and
        so would change it for the tests that follow.
        """
        out, err = io.StringIO(), io.StringIO()
        with (
            pytest.MonkeyPatch.context() as patch,
            contextlib.redirect_stdout(out),
            contextlib.redirect_stderr(err),
        ):
            for name in os.environ.keys() - self.environment.keys():
                patch.delenv(name)
            for name, value in self.environment.items():
                patch.setenv(name, value)
            with pytest.raises(SystemExit) as ended:
                main(words)
            assert dict(os.environ) == self.environment, words
        assert not signal.pthread_sigmask(signal.SIG_BLOCK, ()), words
        assert signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN, words
        assert isinstance(ended.value.code, int)
        assert "Traceback" not in err.getvalue(), err.getvalue()
        return Done(ended.value.code, out.getvalue(), err.getvalue())

    def run_apart(self, *words: str, stdin: str = "", before: str = "", **environment: str) -> Done:
        """Run it in a process of its own.

        Args:
            words: What comes after `actionkit`.
            stdin: What it reads.
            before: Code to run first, in the same process.
            environment: Variables that differ from those of the world.
        """
        code = f"{before}\nfrom actionkit.cli import main; main()"
        done = forked.run(
            [sys.executable, "-c", code, *words],
            input=stdin,
            capture_output=True,
            text=True,
            env=self.environment | environment,
            timeout=PATIENCE,
        )
        assert "Traceback" not in done.stderr, done.stderr
        return Done(done.returncode, without_noise(done.stdout), without_noise(done.stderr))


def _end(process: subprocess.Popen[str]) -> None:
    if process.poll() is None:
        process.send_signal(signal.SIGKILL)
    with contextlib.suppress(ValueError):  # the test closed the pipe
        process.communicate()


@pytest.fixture(scope="module")
def world() -> Iterator[World]:
    """Return a domain, its servers, and the command line in it."""
    with isolated_domain() as domain, ExitStack() as stack:
        yield World(domain, stack)


@pytest.fixture
def empty_world() -> Iterator[World]:
    """Return the same with nothing in it, for one test."""
    with isolated_domain() as domain, ExitStack() as stack:
        yield World(domain, stack)

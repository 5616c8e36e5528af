"""The command `python -m tests.hosts`: what each host does with a real `actionkit mcp`.

Each host is installed by pip into an environment of its own, in a cache folder, and drives the
server over stdio and HTTP. The results are written into the tables of docs/hosts.md. It is no part
of `.ci/run`: it needs PyPI, and the hosts change without us.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click

from actionkit import servers
from actionkit.servers import Server
from actionkit.testing import isolated_domain
from tests.agents.over_mcp.lab import HttpServing, Robot
from tests.tables import DOCS

PAGE = DOCS / "hosts.md"
DRIVERS = Path(__file__).with_name("drivers.py")
_STEPS = ("tools", "call", "default", "approve", "cancel", "timeout")
_PATIENCE = 60.0
"""Seconds for one step of a driver; pip has ten times as long."""
_SOON = 5.0
"""Seconds for a goal to be cancelled after its host has given up."""

CONFIG = """
[tools.count]
action = "/fibonacci"
type = "test_msgs/action/Fibonacci"
timeout = 60.0

[tools.ask]
action = "/fibonacci"
type = "test_msgs/action/Fibonacci"
timeout = 60.0
confirm = "always"

[tools.slow]
action = "/slow"
type = "test_msgs/action/Fibonacci"
timeout = 60.0

[tools.patrol]
action = "/never_finishes"
type = "test_msgs/action/Fibonacci"
timeout = 600.0
"""
"""`count` takes 2 s, `slow` 8 s, and `patrol` never ends by itself."""


@dataclass(frozen=True)
class Host:
    """A host, and what pip installs for it.

    Attributes:
        title: Its name on the page.
        driver: Its name in `drivers.HOSTS`.
        packages: For pip.
        shown: The packages named on the page with their versions.
    """

    title: str
    driver: str
    packages: tuple[str, ...]
    shown: tuple[str, ...]


HOSTS = (
    Host("MCP SDK for Python, 1.x", "sdk-1", ("mcp==1.30.*",), ("mcp",)),
    Host("MCP SDK for Python, 2.x", "sdk-2", ("mcp>=2,<3",), ("mcp",)),
    Host("FastMCP", "fastmcp", ("fastmcp",), ("fastmcp", "mcp")),
    Host("Pydantic AI", "pydantic-ai", ("pydantic-ai-slim[mcp]",), ("pydantic-ai-slim", "mcp")),
    Host(
        "LangChain, `get_tools()`",
        "langchain",
        ("langchain-mcp-adapters",),
        ("langchain-mcp-adapters", "mcp"),
    ),
    Host(
        "LangChain, one `session()`",
        "langchain-session",
        ("langchain-mcp-adapters",),
        ("langchain-mcp-adapters", "mcp"),
    ),
    Host("OpenAI Agents", "openai-agents", ("openai-agents",), ("openai-agents", "mcp")),
    # With the newest mcp, mcpadapt 0.1.19 cannot be imported.
    Host("smolagents", "smolagents", ("smolagents[mcp]", "mcp<2"), ("smolagents", "mcp")),
)


class Environment:
    """The virtual environment of a host."""

    def __init__(self, host: Host, cache: Path) -> None:
        self._folder = cache / "-".join(host.packages).replace("/", "_")
        self.python = self._folder / "bin" / "python"
        self._host = host

    def make(self) -> str:
        """Install what is missing; return why that failed, or nothing."""
        if not self.python.exists():
            subprocess.run([sys.executable, "-m", "venv", self._folder], check=True)
        pip = [self.python, "-m", "pip", "install", "--quiet", *self._host.packages]
        done = subprocess.run(
            pip, check=False, capture_output=True, text=True, timeout=10 * _PATIENCE
        )
        return "" if done.returncode == 0 else done.stderr.strip().splitlines()[-1][:200]

    def versions(self) -> str:
        """Return the packages and versions that the page names."""
        code = "import sys, importlib.metadata as m; print(*map(m.version, sys.argv[1:]))"
        words = [self.python, "-c", code, *self._host.shown]
        found = subprocess.run(words, capture_output=True, text=True, check=True).stdout.split()
        pairs = zip(self._host.shown, found, strict=True)
        return ", ".join(f"{name} {version}" for name, version in pairs)


class Driving:
    """A driver's process, for one step."""

    def __init__(self, python: Path, host: Host, step: str, target: dict[str, Any]) -> None:
        words = [str(python), str(DRIVERS), host.driver, step, json.dumps(target)]
        self._errors = tempfile.TemporaryFile("w+")  # noqa: SIM115  closed by `close`
        self._process = subprocess.Popen(
            words,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._errors,
            text=True,
            cwd="/",
        )
        self._alarm = threading.Timer(_PATIENCE, self._process.kill)
        self._alarm.start()

    def told(self) -> dict[str, Any]:
        """Return what it says next; what it wrote to standard error where it ended instead."""
        assert self._process.stdout is not None
        for line in self._process.stdout:
            if line.startswith("{"):
                return dict(json.loads(line))
        self._process.wait()
        self._errors.seek(0)
        lines = [line for line in self._errors.read().splitlines() if line.strip()]
        return {"raised": lines[-1][:200] if lines else "it ended without a word"}

    def go(self) -> None:
        assert self._process.stdin is not None
        with suppress(BrokenPipeError):  # it has ended, and is told of
            self._process.stdin.write("\n")
            self._process.stdin.flush()

    def close(self) -> None:
        self.go()
        try:
            self._process.wait(_SOON * 2)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._alarm.cancel()
        for pipe in (self._process.stdin, self._process.stdout, self._errors):
            assert pipe is not None
            with suppress(BrokenPipeError):
                pipe.close()


class Trial:
    """One host over one transport."""

    def __init__(
        self, host: Host, python: Path, patrol: Server, domain: int, target: dict[str, Any]
    ) -> None:
        self._host, self._python, self._patrol = host, python, patrol
        self._target, self._domain = target, domain

    @contextmanager
    def _driving(self, step: str) -> Iterator[Driving]:
        driving = Driving(self._python, self._host, step, self._target)
        try:
            yield driving
        finally:
            driving.close()

    def run(self) -> dict[str, str]:
        """Take all steps; return a cell for each column of the page."""
        return {step: getattr(self, f"_{step}")() for step in _STEPS}

    def _tools(self) -> str:
        with self._driving("tools") as driving:
            told = driving.told()
        names = {"count", "ask", "slow", "patrol", "goals"}
        return "yes" if names == set(told.get("tools", ())) else _what(told)

    def _call(self) -> str:
        with self._driving("call") as driving:
            told = driving.told()
        progress = "with progress" if told.get("progress") else "no progress"
        return f"yes, {progress}" if _succeeded(told) else _what(told)

    def _default(self) -> str:
        with self._driving("default") as driving:
            told = driving.told()
        return "succeeds" if _succeeded(told) else _what(told)

    def _approve(self) -> str:
        with self._driving("approve") as driving:
            told = driving.told()
        if _succeeded(told):
            return "works"
        return "refused: it cannot ask" if "nobody_to_ask" in str(told) else _what(told)

    def _cancel(self) -> str:
        return self._given_up("cancel")

    def _timeout(self) -> str:
        return self._given_up("timeout")

    def _given_up(self, step: str) -> str:
        """Let the host give up a goal, and look what becomes of it, in three moments."""
        before = {name: self._patrol.count(name) for name in ("executing", "canceled")}

        def happens(event: str, seconds: float) -> bool:
            try:
                self._patrol.wait_for(event, count=before[event] + 1, timeout=seconds)
            except AssertionError:
                return False
            return True

        with self._driving(step) as driving:
            if not happens("executing", _PATIENCE / 2):
                return _what(driving.told())
            if step == "cancel":
                driving.go()
            told = driving.told()
            if step == "timeout" and "raised" not in told and '"status"' in str(told):
                return _what(told)
            if happens("canceled", _SOON):
                return "goal cancelled"
        left = "**goal runs on**; cancelled when the host disconnects"
        if happens("canceled", 3 * _SOON):
            return left
        self._cancel_all()
        return "**goal runs on**, also after the host"

    def _cancel_all(self) -> None:
        env = os.environ | {"ROS_DOMAIN_ID": str(self._domain)}
        words = [sys.executable, "-m", "actionkit", "cancel", "/never_finishes", "--all"]
        subprocess.run(words, check=False, capture_output=True, timeout=_PATIENCE, env=env)


def _succeeded(told: dict[str, Any]) -> bool:
    text = str(told.get("text", "")).replace("\\", "").replace(" ", "")
    return '"status":"succeeded"' in text or "'status':'succeeded'" in text


def _what(told: dict[str, Any]) -> str:
    text = str(told.get("raised") or told.get("text") or told)
    return " ".join(text.split())[:120].replace("|", "\\|").replace("<", "&lt;")


def _try(host: Host, cache: Path) -> list[tuple[str, dict[str, str]]]:
    """Return a row for each transport: the cells before the steps, and the steps."""
    environment = Environment(host, cache)
    if problem := environment.make():
        return [(f"| {host.title} | - | cannot be installed: {problem} |", {})]
    title = f"{host.title} ({environment.versions()})"
    rows = []
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        domain = stack.enter_context(isolated_domain())
        file = folder / "robot.toml"
        file.write_text(CONFIG)

        def server(name: str, action: str, **options: Any) -> Server:
            started = servers.start(name, action_name=action, domain_id=domain, **options)
            return stack.enter_context(started)

        server("fibonacci", "fibonacci", period=0.1)
        server("fibonacci", "slow", period=0.8)
        patrol = server("never_finishes", "never_finishes")
        robot = Robot(domain, file, stack)
        http = HttpServing(robot)
        stack.callback(http.close)
        command, *arguments = robot.words()
        env = {"PATH": os.environ["PATH"], **robot.environment}
        targets: dict[str, dict[str, Any]] = {
            "stdio": {"command": command, "args": arguments, "env": env},
            "HTTP": {"url": http.url},
        }
        for transport, target in targets.items():
            steps = Trial(host, environment.python, patrol, domain, target).run()
            rows.append((f"{title} | {transport}", steps))
            click.echo(f"{title}, {transport}: {steps}")
    return rows


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.option("--only", multiple=True, type=click.Choice([host.driver for host in HOSTS]))
@click.option(
    "--cache",
    type=click.Path(file_okay=False, path_type=Path),
    default=Path.home() / ".cache" / "actionkit-hosts",
    show_default=True,
    help="Where the environments are kept.",
)
@click.option("--write-docs", is_flag=True, help="Put the results into docs/hosts.md.")
def main(only: tuple[str, ...], cache: Path, write_docs: bool) -> None:
    """Try all hosts, or some of them."""
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    hosts = [host for host in HOSTS if not only or host.driver in only]
    with (
        tempfile.TemporaryDirectory() as holds,
        ThreadPoolExecutor(max_workers=2) as pool,
    ):
        os.environ["ACTIONKIT_HOLD_DIR"] = holds
        found = list(pool.map(lambda host: _try(host, cache), hosts))
    lines = []
    for start, steps in (row for rows in found for row in rows):
        cells = [steps[step] for step in _STEPS] if steps else ["-"] * len(_STEPS)
        lines.append(f"| {start.strip('| ')} | {' | '.join(cells)} |")
    click.echo("\n".join(lines))
    if write_docs:
        _write(lines)


def _write(lines: list[str]) -> None:
    """Replace the rows of the hosts that were tried; the others stay."""
    begin, end = "<!-- table: hosts -->\n", "<!-- end of table -->"
    page = PAGE.read_text("utf-8")
    head, _, rest = page.partition(begin)
    table, _, tail = rest.partition(end)
    old = [line for line in table.splitlines() if line.startswith("|")]
    rows = {row_key(line): line for line in [*old[2:], *lines]}
    wanted = [(host.title, transport) for host in HOSTS for transport in ("stdio", "HTTP", "-")]
    ordered = [rows[key] for key in wanted if key in rows]
    table = "\n".join(["", *old[:2], *ordered, "", ""])
    PAGE.write_text(f"{head}{begin}{table}{end}{tail}", "utf-8")


def row_key(line: str) -> tuple[str, str]:
    """Return the host and the transport of a row."""
    cells = [cell.strip() for cell in line.strip("|").split("|")]
    return cells[0].partition(" (")[0], cells[1]


if __name__ == "__main__":
    main()

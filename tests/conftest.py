"""What tests of the client share: making one, and calling it in its three forms."""

from __future__ import annotations

import asyncio
import gc
import os
import signal
import subprocess
import sys
import threading
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue
from typing import IO, Any

import pytest
from execnet.gateway_base import ThreadExecModel
from hypothesis import HealthCheck, settings

from actionkit import Client, GoalFuture, GoalState, Outcome, Timeouts
from actionkit._goal.stages import FIRST_REASK
from actionkit._threads import diagnostics as _diagnostics
from actionkit.servers import Server, ServerEvent
from tests import forked, shared_memory
from tests.cpu import Cpu
from tests.native import combination

# On a busy machine making an example takes long at times, and trying one does.
settings.register_profile("tests", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("tests")

FORMS = ("blocking", "future", "await")
NEVER = threading.Event()  # nobody sets it: waiting for it is how a test lets time pass


@dataclass
class Answer:
    """The result of one call, in any form."""

    result: Any = None
    error: BaseException | None = None
    outcome: Outcome[Any] | None = None


def ask(form: str, client: Client[Any], goal: Any, **kwargs: Any) -> Answer:
    """Call in one of the three forms and note what comes back."""
    answer = Answer()
    try:
        if form == "blocking":
            answer.result = client.call(goal, **kwargs)
        elif form == "future":
            future = client.call_async(goal, **kwargs)
            answer.outcome = future.outcome(30)
            answer.result = future.result(0)
        else:

            async def main() -> Any:
                future = client.call_async(goal, **kwargs)
                try:
                    return await future
                finally:
                    answer.outcome = future.outcome(0)

            answer.result = asyncio.run(main())
    except Exception as error:  # noqa: BLE001  it is what is asked for
        answer.error = error
    return answer


def cancels(server: Server) -> list[ServerEvent]:
    """Return the requests to cancel a goal that the server was running.

    Those for unknown goals are the client's harmless question whether anybody is there (R2).
    """
    server.sync()
    return [e for e in server.events if e.event == "cancel_requested" and e.details["running"]]


def asked_to_cancel(server: Server, *goal_ids: object, waited: float) -> bool:
    """Whether just these were, once each.

    More than once only where the client waited for an answer until it asked again: the machine may
    stand still for so long.
    """
    asked = [event.goal_id for event in cancels(server)]
    expected = sorted(str(goal_id) for goal_id in goal_ids)
    return sorted(asked if waited < FIRST_REASK / 2 else set(asked)) == expected


def is_accepted(future: GoalFuture[Any, Any]) -> bool:
    """Wait until the client knows that the goal was accepted, which the server knows before.

    A cancel that comes before the client knows is asked for again when it does: the server may
    have had the first request before the goal.
    """
    until = time.monotonic() + 20
    while not any(event.state is GoalState.ACCEPTED for event in future.timeline):
        if time.monotonic() > until:
            return False
        NEVER.wait(0.002)
    return True


def all_is_logged() -> bool:
    """Wait until what the communication thread had to say is written, which is not done there."""
    return _diagnostics.flush(time.monotonic() + 20)


def runs_nothing(server: Server) -> bool:
    """Whether every goal was cancelled; waits for the journal, which is a pipe behind."""
    for goal_id in server.running():
        server.wait_for("canceled", goal_id=goal_id)
    return server.running() == set()


RCLPYS_RACE = "the given context is not valid"
"""Of rclpy's RCLError where a context is shut down between two steps of its executor (R10)."""


@contextmanager
def until_shutdown() -> Iterator[None]:
    """Let an executor spin until its context is shut down; rclpy reports that in several ways."""
    from rclpy.executors import ExternalShutdownException

    from actionkit._ros.rclpy_private.native import RCLError

    try:
        yield
    except ExternalShutdownException:
        pass
    except RCLError as error:
        if RCLPYS_RACE not in str(error):
            raise


TESTS = Path(__file__).parent
_LEFT_OUT = pytest.StashKey[int]()
"""How many tests the marker `long` has left out."""


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--long", action="store_true", help="run the tests that take long, too")
    parser.addoption(
        "--late-journal",
        action="store_true",
        help="deliver what servers write into their journals 100 ms late",
    )
    parser.addoption(
        "--hold-budgets",
        action="store_true",
        help="fail if a tier costs more than a third more CPU time than its budget",
    )
    combination.add_option(parser)
    parser.addoption("--cpu-table", metavar="FILE", help="write what each test costs, as JSON")


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers(config: pytest.Config) -> int:
    """Say how many tests run at a time: as many as keep two cores busy.

    Most tests wait rather than work. Many of the long ones compile.
    """
    return 6 if config.getoption("long") else 10


def pytest_configure(config: pytest.Config) -> None:
    if not (hasattr(config, "workerinput") or config.option.collectonly):
        shared_memory.keep_mending()
        if config.getoption("numprocesses", None) and not sys.dont_write_bytecode:
            # pytest-xdist's processes, each of which would import, and in a fresh checkout compile,
            # what the tests need for itself.
            forked.collected[:] = config.args
            ThreadExecModel.subprocess = forked.SUBPROCESS  # type: ignore
    config.pluginmanager.register(Cpu(config), "cpu")


def pytest_cmdline_main(config: pytest.Config) -> None:
    combination.enter(config)


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    return combination.ignores(config, collection_path) or None


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out tests that take long, unless they are asked for."""
    further = list(_further_variants(items))
    if combination.select(config, items, further):
        return
    for item in further:
        item.add_marker(pytest.mark.long)
    if config.getoption("long"):
        return
    left_out = [item for item in items if item.get_closest_marker("long")]
    config.stash[_LEFT_OUT] = len(left_out)
    if left_out:
        config.hook.pytest_deselected(items=left_out)
        items[:] = [item for item in items if not item.get_closest_marker("long")]


def _further_variants(items: list[pytest.Item]) -> Iterator[pytest.Item]:
    """Yield variants of tests that hold their promise by default with the first and the last.

    Not where the test itself says which variants are long.
    """
    variants: dict[str, list[pytest.Item]] = defaultdict(list)
    chosen: set[str] = set()
    for item in items:
        name, is_variant, _ = item.nodeid.partition("[")
        if any(item.get_closest_marker(mark) for mark in ("every", "long")):
            chosen.add(name)
        elif is_variant and TESTS / "unit" not in item.path.parents:
            variants[name].append(item)
    for name, several in variants.items():
        if name not in chosen:
            yield from several[1:-1]


def pytest_collection_finish() -> None:
    """Have the garbage collector never look again at some hundred thousand objects of pytest's."""
    gc.collect()
    gc.freeze()


def pytest_sessionfinish(session: pytest.Session) -> None:
    if hasattr(session.config, "workeroutput"):  # pytest-xdist: each worker collects all
        session.config.workeroutput["left_out"] = session.config.stash.get(_LEFT_OUT, 0)


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: Any) -> None:
    left_out = getattr(node, "workeroutput", {}).get("left_out", 0)
    node.config.stash[_LEFT_OUT] = max(left_out, node.config.stash.get(_LEFT_OUT, 0))


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    if left_out := terminalreporter.config.stash.get(_LEFT_OUT, 0):
        terminalreporter.write_line(f"{left_out} long tests were left out; --long runs them, too")


@pytest.fixture(scope="session", autouse=True)
def _late_journal(pytestconfig: pytest.Config) -> Iterator[None]:
    """Find tests that read a journal without waiting for what they read, if asked to."""

    def read(server: Server, stdout: IO[bytes]) -> None:
        lines: SimpleQueue[tuple[float, bytes] | None] = SimpleQueue()

        def deliver() -> None:
            while (item := lines.get()) is not None:
                due, line = item
                NEVER.wait(max(0.0, due - time.monotonic()))
                server._journal.add_line(line)
            server._journal.end()

        with stdout, ThreadPoolExecutor(1) as delivering:
            delivering.submit(deliver)
            for line in stdout:
                lines.put((time.monotonic() + 0.1, line))
            lines.put(None)

    with pytest.MonkeyPatch.context() as patch:
        if pytestconfig.getoption("late_journal"):
            patch.setattr(Server, "_read", read)
        yield


@pytest.fixture(scope="session", autouse=True)
def _signals() -> None:
    """Let programs that tests start hear signals, also where the tests run in the background.

    A shell has what it starts there ignore Ctrl-C and SIGQUIT, and `nohup` SIGHUP. That is
    inherited, and for a guard it means that it passes none of them on.
    """
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    for number in (signal.SIGHUP, signal.SIGQUIT):
        if signal.getsignal(number) is signal.SIG_IGN:
            signal.signal(number, signal.SIG_DFL)


@pytest.fixture(scope="session", autouse=True)
def _ros_logs(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Keep the log files of rclpy, of which each process makes one, out of the user's home."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ROS_LOG_DIR", str(tmp_path_factory.mktemp("ros_logs")))
        yield


@pytest.fixture(scope="session", autouse=True)
def _forked_servers() -> Iterator[None]:
    """Fork reference servers, which costs a fifth of starting interpreters for them."""
    from actionkit.servers import _process

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(_process, "subprocess", forked.SUBPROCESS)
        yield


@pytest.fixture(scope="session", autouse=True)
def _servers_of_the_combination(pytestconfig: pytest.Config) -> Iterator[None]:
    yield from combination.servers(pytestconfig)


@pytest.fixture(scope="session", autouse=True)
def _hold_files(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Keep the files of holds apart from those of other runs, which get the same domains."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ACTIONKIT_HOLD_DIR", str(tmp_path_factory.mktemp("holds")))
        yield


@pytest.fixture(scope="session", autouse=True)
def _ledger_files(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Keep the goals of programs that tests kill out of the file of this computer's user."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_STATE_HOME", str(tmp_path_factory.mktemp("state")))
        yield


@pytest.fixture
def make_client(ros_domain: int) -> Iterator[Callable[..., Client[Any]]]:
    """Make clients in the test's domain; all are closed at its end."""
    with ExitStack() as stack:

        def make(action_type: Any = None, name: str = "fibonacci", **kwargs: Any) -> Any:
            from test_msgs.action import Fibonacci

            # On a busy machine a server may come into sight late.
            kwargs.setdefault("timeouts", Timeouts(server=30.0))
            return stack.enter_context(Client(action_type or Fibonacci, name, **kwargs))

        yield make


@pytest.fixture
def own_threads() -> Callable[[], list[str]]:
    """Return the names of ActionKit's threads that are alive, less those of earlier tests.

    One of an earlier test may be watching for a goal that was given up on, or clearing away.
    """
    earlier = set(threading.enumerate())
    return lambda: [
        thread.name
        for thread in set(threading.enumerate()) - earlier
        if thread.name.startswith("actionkit")
    ]


def without_noise(text: str) -> str:
    """Return what a process wrote, without the output of Fast DDS.

    If many processes start at once, in any domains, it complains on either stream of
    a port in shared memory that it did not get, and takes the next.
    """
    lines = text.splitlines(keepends=True)
    return "".join(line for line in lines if "RTPS_TRANSPORT_SHM" not in line)


@dataclass
class Script:
    """A Python script in a process of its own."""

    process: subprocess.Popen[str]

    def line(self) -> str:
        """Return its next line of output; the test's time limit bounds the wait."""
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        return line.strip() if without_noise(line) == line else self.line()

    def finish(self, timeout: float = 20) -> tuple[int, str, str]:
        """Return its exit code and the rest of its output.

        Not by `communicate`, which leaves out what `line` has read beyond its line.
        """
        process = self.process
        assert process.stdout is not None
        assert process.stderr is not None
        if process.stdin is not None:
            with suppress(BrokenPipeError):
                process.stdin.close()
        with process.stdout, process.stderr, ThreadPoolExecutor(2) as readers:
            out, err = readers.submit(process.stdout.read), readers.submit(process.stderr.read)
            try:
                code = process.wait(timeout)
            finally:
                process.kill()  # does nothing to one that has ended; the readers come to an end
            return code, without_noise(out.result()), without_noise(err.result())

    def end(self) -> None:
        """Kill it where it still runs, and free what is left of it."""
        self.process.kill()
        with suppress(ValueError):  # `finish` has closed the pipes
            self.process.communicate()


@pytest.fixture
def run_script(ros_domain: int) -> Iterator[Callable[..., Script]]:
    """Start scripts in the test's domain; what is left of them is killed at its end.

    With `fresh=True` in an interpreter of its own, for what libraries do when it ends.
    """
    started: list[Script] = []

    def run(source: str, *args: str, fresh: bool = False) -> Script:
        popen = subprocess.Popen if fresh else forked.Popen
        process = popen(
            [
                sys.executable,
                "-W",
                "error",
                "-W",
                "ignore::DeprecationWarning",
                "-c",
                source,
                *args,
            ],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env=os.environ | {"PYTHONUNBUFFERED": "1"},
        )
        started.append(Script(process))
        return started[-1]

    yield run
    for script in started:
        script.end()

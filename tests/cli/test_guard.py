"""`actionkit guard` and `actionkit leftovers`: programs that were killed (C12)."""

from __future__ import annotations

import json
import os
import pty
import select
import shlex
import signal
import subprocess
import sys
import uuid
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from types import SimpleNamespace

import pytest
from test_msgs.action import Fibonacci

from actionkit import Ledger
from actionkit._internal_api import client_in_domain
from actionkit.cli import main
from actionkit.cli._shared.exits import Exit
from actionkit.cli.guard import _program
from actionkit.cli.guard._program import Program
from actionkit.servers import Server
from tests import forked
from tests.waiting import until

from .test_terminal import IN_TERMINAL, Terminal

ENOUGH = 30.0
#: Tells of each signal, and ends with 7 after the second one, or at the end of its input.
COUNTS = """
import os, signal, sys
def told(number, frame):
    os.write(1, f"{signal.Signals(number).name}\\n".encode())  # `print` is not reentrant
for name in ("SIGINT", "SIGTERM", "SIGUSR1", "SIGQUIT"):
    signal.signal(signal.Signals[name], told)
print(os.environ["ACTIONKIT_LEDGER"], os.getpid(), flush=True)
for line in sys.stdin:
    print("got", line, end="", flush=True)
sys.exit(7)
"""
#: Starts a process that writes in the ledger, and tells of its signals. It ends by SIGTERM, but in
#: a "daemon" only by SIGKILL.
STARTS = """
import os, signal, sys, time
from actionkit._calls.ledger.file import LedgerFile

how = sys.argv[1]
ready, is_ready = os.pipe()
if os.fork() == 0:
    if how == "daemon":
        os.setsid()
    if how == "daemon" and os.fork():
        os._exit(0)
    def told(number, frame):
        os.write(1, f"{signal.Signals(number).name}\\n".encode())
        if number == signal.SIGTERM and how != "daemon":
            os._exit(0)
    wanted = signal.SIGINT, signal.SIGTERM, signal.SIGUSR1
    for number in wanted:
        signal.signal(number, told)  # they may have been ignored
    signal.pthread_sigmask(signal.SIG_BLOCK, wanted)
    LedgerFile(os.environ["ACTIONKIT_LEDGER"])
    os.write(1, f"{os.getpid()}\\n".encode())
    os.write(is_ready, b".")
    while True:
        told(signal.sigwait(wanted), None)  # pause() would miss one that comes just before it
os.read(ready, 1)
if how == "ros2 run":
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # its child gets it, too
if how != "background":
    os.write(1, b"up\\n")
    os.wait()
    signal.pause()
sys.exit(7)
"""
LEAVES = """
import sys, uuid
from test_msgs.action import Fibonacci

from actionkit import Ledger
from actionkit._internal_api import client_in_domain
path, goal_id, domain, action = sys.argv[1:]
Ledger(path)._add(uuid.UUID(goal_id), action, "test_msgs/action/Fibonacci", int(domain))
"""


@pytest.fixture
def path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    monkeypatch.delenv("ACTIONKIT_LEDGER", raising=False)
    return tmp_path / "actionkit" / "goals.db"


@pytest.fixture
def guard(path: Path) -> Iterator[subprocess.Popen[str]]:
    """A guard with COUNTS."""
    words = [sys.executable, "-m", "actionkit", "guard", sys.executable, "-c", COUNTS]
    pipe = subprocess.PIPE
    with forked.Popen(words, stdin=pipe, stdout=pipe, text=True, env=dict(os.environ)) as process:
        yield process
        process.kill()


def lines(process: subprocess.Popen[str], count: int) -> list[str]:
    assert process.stdout is not None
    return [process.stdout.readline().rstrip() for _ in range(count)]


def test_signals_input_output_and_the_exit_code_pass_through(
    guard: subprocess.Popen[str], path: Path
) -> None:
    (first,) = lines(guard, 1)
    assert first.split()[0] == str(path)
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGUSR1, signal.SIGQUIT):
        guard.send_signal(number)
        assert lines(guard, 1) == [number.name]
    assert guard.stdin is not None
    print("a line", file=guard.stdin, flush=True)
    assert lines(guard, 1) == ["got a line"]
    guard.stdin.close()
    assert guard.wait(ENOUGH) == 7


def test_no_thread_of_the_guard_takes_a_signal_away(guard: subprocess.Popen[str]) -> None:
    """They are waited for, to know who has sent them; elsewhere they would end the guard."""
    lines(guard, 1)
    tasks = list(Path(f"/proc/{guard.pid}/task").iterdir())
    assert len(tasks) > 1
    for task in tasks:
        blocked = next(
            line for line in (task / "status").read_text().splitlines() if "SigBlk" in line
        )
        mask = int(blocked.split()[1], 16)
        if int(task.name) != guard.pid:  # the main thread waits for them
            assert mask >> (signal.SIGTERM - 1) & 1, task.name


def test_it_ends_by_the_signal_that_has_ended_the_program(guard: subprocess.Popen[str]) -> None:
    ((_, pid),) = (line.split() for line in lines(guard, 1))
    os.kill(int(pid), signal.SIGKILL)
    assert guard.wait(ENOUGH) == -signal.SIGKILL


def test_if_the_guard_is_killed_its_program_is_told_to_end(guard: subprocess.Popen[str]) -> None:
    lines(guard, 1)
    guard.kill()
    guard.wait(ENOUGH)
    assert guard.stdin is not None
    guard.stdin.close()  # which ends it, too
    assert lines(guard, 1) == ["SIGTERM"]


@contextmanager
def in_terminal(*words: str) -> Iterator[Terminal]:
    """A guard with a program in a terminal."""
    master, slave = pty.openpty()
    command = [sys.executable, "-c", IN_TERMINAL, "guard", sys.executable, "-c", *words]
    process = subprocess.Popen(command, stdin=slave, stdout=slave, stderr=slave, close_fds=True)
    os.close(slave)
    try:
        yield Terminal(process, master)
    finally:
        process.kill()
        process.wait()
        os.close(master)


def test_ctrl_c_in_a_terminal_reaches_the_program_once(path: Path) -> None:
    with in_terminal(COUNTS) as terminal:
        terminal.until(str(path))
        terminal.press(b"\x03")
        terminal.until("SIGINT")
        terminal.press(b"\x04")  # Ctrl-D, the end of its input
        assert terminal.finish() == 7
        assert terminal.text.count("SIGINT") == 1


def test_each_ctrl_c_reaches_what_the_program_has_started_once(path: Path) -> None:
    with in_terminal(STARTS, "dies") as terminal:
        terminal.until("up")
        terminal.press(b"\x03")
        terminal.until("waiting for process")  # the program has ended
        terminal.press(b"\x03")
        terminal.until("which the program has started\r\n^CSIGINT")
        terminal.process.send_signal(signal.SIGTERM)
        assert terminal.finish() == -signal.SIGINT
        assert terminal.text.count("SIGINT") == 2
        assert terminal.text.count("SIGTERM") == 1


@pytest.fixture
def starting(path: Path) -> Iterator[Callable[[str], tuple[subprocess.Popen[str], int]]]:
    """Starts guards with STARTS. Gives the guard, and the id of the process that writes."""
    with ExitStack() as stack:

        def start(how: str) -> tuple[subprocess.Popen[str], int]:
            words = [sys.executable, "-m", "actionkit", "guard", sys.executable, "-c", STARTS, how]
            pipe = subprocess.PIPE
            environment = dict(os.environ)
            options = {"stdout": pipe, "stderr": pipe, "text": True, "env": environment}
            guard = stack.enter_context(forked.Popen(words, **options))
            stack.callback(guard.kill)
            said = lines(guard, 1 if how == "background" else 2)
            pid = next(int(line) for line in said if line.isdecimal())
            stack.callback(kill, pid)
            return guard, pid

        yield start


def kill(pid: int) -> None:
    with suppress(ProcessLookupError):
        os.kill(pid, signal.SIGKILL)


def rest(guard: subprocess.Popen[str]) -> tuple[str, str]:
    assert guard.stdout is not None
    assert guard.stderr is not None
    return guard.stdout.read(), guard.stderr.read()


Starting = Callable[[str], tuple[subprocess.Popen[str], int]]


def test_a_signal_reaches_what_the_program_has_started(starting: Starting) -> None:
    """`ros2 run` ends by SIGTERM and tells nobody, and leaves SIGINT to its child."""
    guard, pid = starting("ros2 run")
    guard.send_signal(signal.SIGINT)
    assert lines(guard, 1) == ["SIGINT"]
    guard.send_signal(signal.SIGTERM)
    assert guard.wait(ENOUGH) == -signal.SIGTERM
    out, err = rest(guard)
    assert out == "SIGTERM\n"
    assert f"sending SIGTERM to process {pid} ({sys.executable} -c" in err
    with pytest.raises(ProcessLookupError):
        os.kill(pid, 0)


def test_the_guard_waits_for_what_the_program_leaves_in_the_background(starting: Starting) -> None:
    guard, pid = starting("background")
    assert guard.stderr is not None
    assert select.select([guard.stderr], [], [], ENOUGH)[0]
    assert guard.stderr.readline().startswith(f"actionkit guard: waiting for process {pid} (")
    guard.send_signal(signal.SIGUSR1)
    assert lines(guard, 1) == ["SIGUSR1"]
    kill(pid)
    assert guard.wait(ENOUGH) == 7
    assert rest(guard) == ("", "")


@pytest.mark.long
def test_a_daemon_that_ignores_signals_is_killed(starting: Starting) -> None:
    guard, pid = starting("daemon")
    guard.send_signal(signal.SIGTERM)
    assert guard.wait(ENOUGH) == -signal.SIGTERM
    out, err = rest(guard)
    assert out == "SIGTERM\n"
    assert f"sending SIGKILL to process {pid} " in err


@pytest.mark.parametrize("crashes", [False, True])
def test_what_may_soon_write_is_told_to_end(crashes: bool, path: Path) -> None:
    """A mission that imports ROS writes nothing yet."""
    program = f"sleep 99 & echo $!; {'kill -9 $$' if crashes else 'wait'}"
    words = [sys.executable, "-m", "actionkit", "guard", "sh", "-c", program]
    pipe = subprocess.PIPE
    with forked.Popen(words, stdout=pipe, text=True, env=dict(os.environ)) as guard:
        (pid,) = map(int, lines(guard, 1))
        if not crashes:
            guard.send_signal(signal.SIGTERM)
        try:
            assert guard.wait(ENOUGH) == -(signal.SIGKILL if crashes else signal.SIGTERM)
            with pytest.raises(ProcessLookupError):
                os.kill(pid, 0)
        finally:
            kill(pid)


def test_a_signal_that_is_ignored_ends_nothing(path: Path) -> None:
    """As SIGHUP is under `nohup`."""
    guarded = "sleep 99 & echo $!; read line"
    script = f"trap '' HUP; exec {sys.executable} -m actionkit guard sh -c '{guarded}'"
    pipe = subprocess.PIPE
    with subprocess.Popen(["sh", "-c", script], stdin=pipe, stdout=pipe, text=True) as guard:
        (pid,) = map(int, lines(guard, 1))
        guard.send_signal(signal.SIGHUP)
        try:
            assert guard.stdin is not None
            print(file=guard.stdin, flush=True)
            assert guard.wait(ENOUGH) == 0
            os.kill(pid, 0)  # it goes on
        finally:
            kill(pid)


def test_a_guard_that_nobody_hears_cancels_all_the_same(path: Path, ros_domain: int) -> None:
    leaves = [sys.executable, "-c", LEAVES, str(path), str(uuid.uuid4()), str(ros_domain)]
    program = f"{shlex.join([*leaves, '/nobody'])}; kill -9 $$"
    words = [sys.executable, "-m", "actionkit", "guard", "--timeout", "0.2", "sh", "-c", program]
    read, write = os.pipe()
    os.close(read)
    with forked.Popen(words, stderr=write, env=dict(os.environ)) as guard:
        os.close(write)
        assert guard.wait(ENOUGH) == -signal.SIGKILL


def test_a_signal_does_not_end_the_guard_while_it_cancels(path: Path, ros_domain: int) -> None:
    leaves = [sys.executable, "-c", LEAVES, str(path), str(uuid.uuid4()), str(ros_domain)]
    words = [sys.executable, "-m", "actionkit", "guard", "--timeout", "0.5", *leaves, "/nobody"]
    pipe = subprocess.PIPE
    with forked.Popen(words, stdout=pipe, stderr=pipe, text=True, env=dict(os.environ)) as guard:
        assert guard.stderr is not None
        assert "has left goals, which are cancelled now" in guard.stderr.readline()
        guard.send_signal(signal.SIGTERM)
        assert guard.wait(ENOUGH) == 0
        _, err = rest(guard)
    assert "cancelling the goals that the program has left. Again, and it ends at once" in err
    assert "goals MAY STILL BE RUNNING" in err


@pytest.mark.parametrize(("code", "passed_on"), [(0x80, False), (0, True)], ids=["tty", "kill"])
def test_what_a_terminal_has_told_the_whole_group_is_not_passed_on(
    code: int, passed_on: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    sent: list[int] = []
    program, own = Program(set, lambda _: None), os.getpid()  # which is in our group
    told = SimpleNamespace(si_signo=signal.SIGINT, si_code=code)
    monkeypatch.setattr(signal, "sigtimedwait", lambda *_: told)
    monkeypatch.setattr(program, "_send", lambda pid, number: sent.append(pid))
    assert program._hear({own})
    assert sent == ([own] if passed_on else [])
    assert program._heard == (set() if passed_on else {own})


@pytest.mark.parametrize("warned", [False, True])
def test_what_does_not_end_is_killed(warned: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    now, sent, said = 0.0, list[tuple[float, int]](), list[str]()
    program = Program(set, said.append)
    program.told, program._heard = True, {99} if warned else set()

    def hear(pids: set[int], seconds: float = 1.0) -> bool:
        nonlocal now
        now += 1.0
        return False

    monkeypatch.setattr(_program, "time", SimpleNamespace(monotonic=lambda: now))
    monkeypatch.setattr(_program, "_ended", dict)  # else it would wait for the test's children
    monkeypatch.setattr(program, "_hear", hear)
    monkeypatch.setattr(program, "_send", lambda pid, number: sent.append((now, number)))
    assert not program._await(lambda: {99}, lambda: False)
    # One that has had Ctrl-C may need a moment.
    assert sent == [(4.0 if warned else 0.0, signal.SIGTERM), (8.0, signal.SIGKILL)]
    assert said[-1].endswith("cannot be ended")


def test_a_ledger_that_was_removed_tells_nothing(path: Path, tmp_path: Path) -> None:
    words = ["sh", "-c", f"rm {path}*; : > {path}"]
    words = [sys.executable, "-m", "actionkit", "guard", *words]
    ended = forked.run(words, stderr=subprocess.PIPE, text=True, timeout=ENOUGH)
    assert ended.returncode == Exit.FAILED
    assert "not known which goals the program has left (another file is in the" in ended.stderr
    assert "They MAY STILL BE RUNNING" in ended.stderr
    assert "nothing was sent" not in ended.stderr


@pytest.mark.parametrize(
    ("words", "code", "told"),
    [
        (["/no/such/program"], Exit.NOT_FOUND, "the command '/no/such/program' is not there"),
        (["/etc/passwd"], Exit.NOT_EXECUTABLE, "'/etc/passwd' cannot be run (Permission denied)"),
        (["--ledger", "/proc/goals.db", "true"], Exit.FAILED, "/proc/goals.db cannot be used"),
    ],
)
def test_a_program_that_cannot_be_run(
    words: list[str], code: int, told: str, path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert code_of(["guard", *words]) == code
    assert told in capsys.readouterr().err


def code_of(words: list[str]) -> object:
    with pytest.raises(SystemExit) as ended:
        main(words)
    return ended.value.code


def leave(path: Path, domain: int = 0, action: str = "/nobody") -> uuid.UUID:
    """Leave a goal that was never sent; return its id. The usual action has no server here."""
    goal_id = uuid.uuid4()
    path.parent.mkdir(exist_ok=True)
    words = [str(path), str(goal_id), str(domain), action]
    forked.run([sys.executable, "-c", LEAVES, *words], check=True, timeout=ENOUGH)
    return goal_id


def test_leftovers_are_shown(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert code_of(["leftovers"]) == Exit.OK
    assert capsys.readouterr().out == "No goal is left over.\n"
    goal_id = leave(path)
    assert code_of(["leftovers", str(path)]) == Exit.CANCEL_UNKNOWN
    told = capsys.readouterr().out
    assert f"/nobody  {goal_id}  sent 20" in told
    assert " s ago) by process" in told
    assert code_of(["leftovers", "--json"]) == Exit.CANCEL_UNKNOWN
    told = json.loads(capsys.readouterr().out)
    assert (told["kind"], told["goal_id"], told["cancel"]) == ("leftover", str(goal_id), None)


def test_a_goal_without_a_server_is_named_and_stays(
    path: Path, ros_domain: int, capfd: pytest.CaptureFixture[str]
) -> None:
    goal_id = leave(path, ros_domain)
    assert code_of(["guard", "--timeout", "1", "true"]) == Exit.OK
    said = capfd.readouterr().err
    assert said.count(f"/nobody  {goal_id}  sent ") == 2
    assert said.count("UNKNOWN: No server has confirmed it") == 2
    assert "an earlier program has left goals" in said
    assert "MAY STILL BE RUNNING. `actionkit leftovers`" in said
    assert code_of(["leftovers", "--cancel", "--timeout", "1"]) == Exit.CANCEL_UNKNOWN
    assert f"{goal_id}  sent" in capfd.readouterr().out
    assert [goal.goal_id for goal in until(Ledger(path).leftovers)] == [goal_id]


@pytest.mark.long
def test_only_the_goals_of_actions_without_a_server_are_forgotten(
    path: Path,
    ros_domain: int,
    action_server: Callable[..., Server],
    capfd: pytest.CaptureFixture[str],
) -> None:
    server = action_server("fibonacci")
    words = ["leftovers", "--cancel", "--timeout", "7", "--forget"]
    with client_in_domain(ros_domain, Fibonacci, "fibonacci") as client:  # sees what is paused
        assert client.wait_for_server(ENOUGH)
        server.pause()
        kept = leave(path, ros_domain, "/fibonacci")
        leave(path, ros_domain)
        assert code_of(["leftovers", "--forget"]) == Exit.USAGE
        assert code_of(words) == Exit.CANCEL_UNKNOWN
        assert capfd.readouterr().out.count("Removed from the file: no server of its action") == 1
        assert [goal.goal_id for goal in Ledger(path).leftovers()] == [kept]
        server.resume()
        assert code_of(words) == Exit.OK
        assert Ledger(path).leftovers() == []

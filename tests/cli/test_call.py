"""`actionkit call`: every exit code, its output, and what happens to the goal (C6.3)."""

from __future__ import annotations

import json
import re
import signal
import subprocess
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from test_msgs.action import Fibonacci

from actionkit import Client, JsonLines, Timeouts
from actionkit.cli._shared.exits import Exit
from actionkit.servers import Server
from tests.cli.conftest import FIBONACCI, NESTED, Running, World, compare
from tests.conftest import without_noise


def interrupt(running: Running, server: Server) -> None:
    running.until("Goal accepted")
    running.signal(signal.SIGINT)


def interrupt_twice(running: Running, server: Server) -> None:
    interrupt(running, server)
    running.until("Canceling goal...")
    # One press of Ctrl-C may come as two signals, so the second is heard only a moment later.
    server.wait_for("cancel_requested", goal_id=goal_id(running.text))
    running.signal(signal.SIGINT)
    while running.process.poll() is None:
        running.signal(signal.SIGINT)


def interrupt_a_stopped_server(running: Running, server: Server) -> None:
    running.until("Goal accepted")
    server.pause()
    running.signal(signal.SIGINT)


def end_one_of_two(running: Running, server: Server) -> None:
    server.wait_for("executing", count=2)
    server.release(1)


@dataclass
class Scene:
    """One call, and how it ends."""

    code: Exit
    server: str | None
    """The reference server; `None` for none at all."""
    goal: str = "{order: 100}"
    words: tuple[str, ...] = ()
    says: str = ""
    options: dict[str, Any] = field(default_factory=dict)
    action: str = ""
    kind: str = FIBONACCI
    act: Callable[[Running, Server], None] | None = None
    apart: bool = False
    """Whether in a domain of its own: a process that is stopped, or leaves at once, may do so with
    a lock of Fast DDS's, and then its peers may not hear others any more."""


CODE_102 = "{nested_field: {int32_value: 102}}"
SCENES = {
    "succeeds": Scene(Exit.OK, "fibonacci", "{order: 5}", says="status: SUCCEEDED"),
    "feedback": Scene(Exit.OK, "fibonacci", "{order: 3}", ("-f",), says="Feedback:"),
    "json": Scene(Exit.OK, "fibonacci", '{"order": 3}', ("--json",), says='"exit_code":0'),
    "rejected": Scene(Exit.REJECTED, "fibonacci", "{order: -1}", says="Goal was rejected."),
    "aborted": Scene(Exit.ABORTED, "aborts", "{order: 3}", says="status: ABORTED"),
    "canceled-by-another": Scene(
        Exit.CANCELED, "cancels_itself", "{order: 3}", says="not by this client"
    ),
    "timed-out": Scene(
        Exit.TIMED_OUT, "never_finishes", words=("--timeout", "6"), says="runs no more"
    ),
    "no-server": Scene(
        Exit.NO_SERVER,
        None,
        words=("--server-timeout", "0.3"),
        says="No action server has come into sight so far",
    ),
    "server-lost": Scene(Exit.SERVER_LOST, "vanishes", says="was lost", apart=True),
    "type-mismatch": Scene(Exit.TYPE_MISMATCH, "wrong_type", says=NESTED),
    "result-lost": Scene(
        Exit.RESULT_LOST,
        "no_result",
        "{order: 3}",
        words=("--result-timeout", "1"),
        says="result cannot be had",
    ),
    "result-late": Scene(
        Exit.RESULT_LOST,
        "no_result",
        "{order: 3}",
        words=("--timeout", "6", "--cancel-timeout", "0.5"),
        says="ended as SUCCEEDED; its result did not come within the time of --timeout",
    ),
    "no-answer": Scene(
        Exit.NO_ANSWER, "silent", words=("--accept-timeout", "0.5"), says="neither accepted nor"
    ),
    "stalled": Scene(
        Exit.STALLED, "never_finishes", words=("--feedback-timeout", "0.5"), says="no feedback for"
    ),
    "judged": Scene(
        Exit.JUDGED,
        "error_code",
        CODE_102,
        ("--ok", "nested_field.int32_value=0"),
        "a failure",
        {"ends": "succeeded"},
        kind=NESTED,
    ),
    "retries-exhausted": Scene(
        Exit.RETRIES_EXHAUSTED,
        "error_code",
        CODE_102,
        ("--transient", "nested_field.int32_value=102", "--retries", "1"),
        "The retries ended",
        {"ends": "succeeded"},
        kind=NESTED,
    ),
    "runs-elsewhere": Scene(
        Exit.CANCEL_UNKNOWN,
        "twins",
        says=" of this call MAY STILL BE RUNNING: ",
        options={"gate": 1},
        act=end_one_of_two,
        apart=True,
    ),
    "interrupted": Scene(
        Exit.INTERRUPTED, "never_finishes", says="Goal canceled: CONFIRMED", act=interrupt
    ),
    "interrupted-ended": Scene(
        Exit.INTERRUPTED,
        "no_result",
        "{order: 3}",
        words=("--cancel-timeout", "2"),
        says="Too late to cancel: the goal had ended as SUCCEEDED. Its result did not come.",
        act=interrupt,
    ),
    "interrupted-refused": Scene(
        Exit.INTERRUPTED,
        "refuses_cancel",
        "{order: 5000}",
        # Shorter than the goal; long enough to ask once more, as an answer may get lost.
        words=("--cancel-timeout", "2"),
        says="REFUSED by the server. IT IS STILL RUNNING",
        act=interrupt,
    ),
    "interrupted-unanswered": Scene(
        Exit.INTERRUPTED,
        "never_finishes",
        words=("--cancel-timeout", "0.5"),
        says="MAY STILL BE RUNNING",
        act=interrupt_a_stopped_server,
        apart=True,
    ),
    "interrupted-twice": Scene(
        Exit.INTERRUPTED,
        "slow_cancel",
        words=("--cancel-timeout", "30"),
        says="Left at once. Goal",
        options={"gate": 1},
        act=interrupt_twice,
        apart=True,
    ),
    "wrong-goal": Scene(Exit.USAGE, "fibonacci", "{oder: 5}", says="did you mean 'order'?"),
    "wrong-type": Scene(
        Exit.USAGE, "fibonacci", kind="test_msg/action/Fibonaci", says=f"Did you mean {FIBONACCI}?"
    ),
}


CAPTURED = ("succeeds", "no-server", "aborted", "timed-out", "interrupted", "interrupted-refused")
"""The scenes that docs/command-line.md shows."""


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=pytest.mark.long if name.startswith("interrupted-") else ())
        for name in SCENES
    ],
)
def test_a_call(name: str, world: World, empty_world: World) -> None:
    scene = SCENES[name]
    here = empty_world if scene.server is None or scene.apart else world
    options = {"period": 0.1} if scene.server == "fibonacci" else scene.options
    server = scene.server and here.server(scene.server, **options)
    action = f"/{scene.server or 'fibonacci'}"
    words = ["call", action, scene.kind, scene.goal, *scene.words]
    if scene.act is None:
        done = here.run(*words)
        code, text = done.code, done.out + done.err
    else:
        assert isinstance(server, Server)
        running = here.start(*words)
        scene.act(running, server)
        code = running.finish()
        text = running.text

    assert code == scene.code, text
    assert scene.says in text
    assert "Traceback" not in text
    if isinstance(server, Server) and scene.act is not None:
        assert_came_to(name, server, goal_id(text))
    if name in CAPTURED:
        shown = f"$ {shell(words)}\n{text}[exit code {code}: {scene.code.name}]\n"
        compare(f"call-{name}.txt", shown)


def assert_came_to(name: str, server: Server, goal: str) -> None:
    """What the command said of the goal is what its server saw."""
    if name == "interrupted":
        server.wait_for("canceled", goal_id=goal)
        assert goal not in server.running()
    elif name == "interrupted-refused":
        server.wait_for("cancel_refused", goal_id=goal)
        assert goal in server.running()
    elif name in ("interrupted-ended", "runs-elsewhere"):
        server.wait_for("succeeded", goal_id=goal)
    elif name == "interrupted-unanswered":
        assert goal in server.running()
        server.resume()
    else:
        server.wait_for("cancel_requested", goal_id=goal)
        server.release(1)


def shell(words: list[str]) -> str:
    quoted = [f"'{word}'" if re.search(r"[\s{}\"]", word) else word for word in words]
    return "actionkit " + " ".join(quoted)


def goal_id(text: str) -> str:
    found = re.search(r"accepted with ID: ([\w-]{36})\n", text)
    assert found, text
    return found[1]


# --- the other rows of the table ---------------------------------------------------------------


ELSEWHERE = {
    Exit.FAILED: "test_doctor.py",
    Exit.NO_ROS: "test_usage.py",
    Exit.CANCEL_REFUSED: "test_cancel.py",
    Exit.NO_SUCH_GOAL: "test_cancel.py",
    Exit.HELD: "test_stop.py",
    Exit.NOT_EXECUTABLE: "test_guard.py",
    Exit.NOT_FOUND: "test_guard.py",
    Exit.HANGUP: "test_terminal.py",
    Exit.OUTPUT_CLOSED: "test_a_closed_pipe_cancels_the_goal, below",
    Exit.TERMINATED: "test_sigterm_is_as_ctrl_c, below",
}


def test_every_exit_code_has_a_test() -> None:
    assert {scene.code for scene in SCENES.values()} | set(ELSEWHERE) == set(Exit)


def test_a_deadline_without_a_server_is_no_server(world: World) -> None:
    done = world.run("call", "nobody", FIBONACCI, "--timeout", "0.5", "--json")
    assert done.code == Exit.NO_SERVER
    last = json.loads(done.out.splitlines()[-1])
    assert (last["outcome"], last["exit"]) == ("ServerUnavailableError", "NO_SERVER")
    assert (last["cancel"], last["state"]) == ("NOT_NEEDED", "TIMED_OUT")
    assert re.search(r"after \d+\.\d s of looking, so nothing was sent", last["error"])


def test_sigterm_is_as_ctrl_c(world: World) -> None:
    server = world.server("never_finishes")
    running = world.start("call", "never_finishes", FIBONACCI, "--json")
    running.until('"state":"ACCEPTED"')
    running.signal(signal.SIGTERM)
    assert running.finish() == Exit.TERMINATED, running.text
    records = [json.loads(line) for line in running.text.splitlines()]
    last = records[-1]
    # By a cancel, and not just by the end of the client. CANCELING is not seen where the end of the
    # goal comes before the answer to the cancel.
    assert (last["outcome"], last["cancel"]) == ("cancelled", "CONFIRMED")
    assert (last["state"], last["exit"], last["exit_code"]) == ("CANCELED", "TERMINATED", 143)
    server.wait_for("canceled", goal_id=last["goal_id"])


LOSES_CTRL_C = """
import signal, sys
class Finder:
    def find_spec(self, name, *rest):
        if name == "actionkit.cli.call._calling":
            try:
                signal.raise_signal(signal.SIGINT)
            except KeyboardInterrupt:
                {then}
sys.meta_path.insert(0, Finder())
"""


@pytest.mark.parametrize("then", ["pass", "raise RuntimeError('calling __set_name__')"])
def test_ctrl_c_that_an_import_loses_ends_the_call_before_the_goal_is_sent(
    world: World, then: str
) -> None:
    server = world.server("never_finishes")
    server.sync()
    before = server.count("goal_received")
    words = ("call", "never_finishes", FIBONACCI)
    done = world.run_apart(*words, before=LOSES_CTRL_C.format(then=then))
    assert (done.code, done.out, done.err.strip()) == (Exit.INTERRUPTED, "", "Interrupted.")
    server.sync()
    assert server.count("goal_received") == before


@pytest.mark.long
def test_what_still_runs_is_told_even_where_nobody_reads_the_output(world: World) -> None:
    server = world.server("slow_cancel", gate=1)
    words = ("call", "slow_cancel", FIBONACCI, "--cancel-timeout", "0.3")
    running = world.start(*words, stderr=subprocess.PIPE)
    running.until("Goal accepted")
    assert running.process.stdout is not None
    running.process.stdout.close()
    assert running.process.wait(20) == Exit.OUTPUT_CLOSED
    assert running.process.stderr is not None
    assert "MAY STILL BE RUNNING" in running.process.stderr.read()
    assert goal_id(running.text) in server.running()
    server.release(1)


@pytest.mark.parametrize("writes", [False, True])
def test_a_closed_pipe_cancels_the_goal(world: World, writes: bool) -> None:
    """It is noticed also where nothing is written any more, as that goal sends no feedback."""
    name = "countdown" if writes else "never_finishes"
    server = world.server(name)
    words = ["call", name, FIBONACCI, "{order: 1000}", *(["-f"] if writes else [])]
    running = world.start(*words, stderr=subprocess.PIPE)
    running.until("Goal accepted" if not writes else "Feedback:")
    assert running.process.stdout is not None
    running.process.stdout.close()
    assert running.process.wait(20) == Exit.OUTPUT_CLOSED
    assert running.process.stderr is not None
    told = without_noise(running.process.stderr.read())
    assert re.sub(r"Progress: .*\n", "", told) == ""
    server.wait_for("canceled", goal_id=goal_id(running.text))
    assert goal_id(running.text) not in server.running()


CLOSED = "standard output cannot be written (Bad file descriptor)"
FULL = "standard output cannot be written (No space left on device)"


@pytest.mark.parametrize(
    ("before", "told"),
    [
        ("r, w = os.pipe(); os.close(r); os.dup2(w, 1)", ""),  # `| no-such-command`
        ("os.dup2(os.open('/dev/full', os.O_WRONLY), 1)", FULL),
        ("os.close(1); sys.stdout = None", CLOSED),  # `>&-`, as Python sees it
    ],
    ids=["no reader", "full", "closed"],
)
def test_nothing_is_sent_if_nobody_can_get_the_output(world: World, before: str, told: str) -> None:
    server = world.server("never_finishes")
    server.sync()
    sent = server.count("goal_received")
    words = ("call", "never_finishes", FIBONACCI)
    done = world.run_apart(*words, before=f"import os, sys; {before}")
    expected = f"Error: {told}.\n" if told else ""
    assert (done.code, done.err) == (Exit.OUTPUT_CLOSED, f"{expected}Nothing was sent.\n")
    server.sync()
    assert server.count("goal_received") == sent


@pytest.mark.long
def test_a_signal_that_was_ignored_stays_ignored(world: World) -> None:
    """As under nohup, or in the background of a script."""
    server = world.server("fibonacci", gate=1)
    ignore = "import signal; signal.signal(signal.SIGINT, signal.SIG_IGN)"
    running = world.start("call", "fibonacci", FIBONACCI, "{order: 2}", before=ignore)
    running.until("Goal accepted")
    running.signal(signal.SIGINT)
    server.release(1)
    assert running.finish() == Exit.OK, running.text
    assert "Canceling" not in running.text


# --- what is asked for and what is told --------------------------------------------------------


@pytest.mark.long
def test_json_tells_every_state_in_order_and_the_outcome_last(world: World) -> None:
    world.server("fibonacci", period=0.1)
    goal = json.dumps({"order": 6})
    done = world.run_apart("call", "fibonacci", FIBONACCI, "--stdin", "--json", "-f", stdin=goal)
    assert (done.code, done.err) == (Exit.OK, "")
    records = [json.loads(line) for line in done.out.splitlines()]
    states = [record["state"] for record in records if record["kind"] == "event"]
    assert [state for state in states if state not in ("EXECUTING", "FEEDBACK")] == [
        "SENDING",
        "SENT",
        "ACCEPTED",
        "SUCCEEDED",
    ]
    feedback = [record for record in records if record.get("state") == "FEEDBACK"]
    assert feedback[0]["detail"] == "no. 1"
    assert feedback[0]["feedback"]["sequence"][:2] == [0, 1]
    # All feedback is told before the end that it came before.
    assert states[-1] == "SUCCEEDED"
    assert [record["kind"] for record in records].index("outcome") == len(records) - 1
    assert records[0]["goal"] == {"order": 6}
    assert records[-1]["result"] == {"sequence": [0, 1, 1, 2, 3, 5, 8]}
    assert (records[-1]["exit"], records[-1]["feedback_not_shown"]) == ("OK", 0)
    assert {record["goal_id"] for record in records} == {records[-1]["goal_id"]}


def test_json_is_what_the_observer_writes_and_timeline_reads_it(
    world: World, tmp_path: Path
) -> None:
    world.server("fibonacci", period=0.1)
    log = tmp_path / "goals.jsonl"
    domain = {"ROS_DOMAIN_ID": str(world.domain)}
    with pytest.MonkeyPatch.context() as patch:
        for name, value in domain.items():
            patch.setenv(name, value)
        patient = Timeouts(server=30.0)
        with (
            JsonLines(log) as observer,
            Client(Fibonacci, "fibonacci", observers=[observer], timeouts=patient) as client,
        ):
            client.call({"order": 6}, timeout=30.0)
    done = world.run("call", "fibonacci", FIBONACCI, "{order: 6}", "--json", "-f")
    shown = [json.loads(line) for line in done.out.splitlines()]
    written = [json.loads(line) for line in log.read_text().splitlines()]

    def schema(records: list[dict[str, Any]]) -> dict[str, set[str]]:
        return {f"{r['kind']} {r['state']}": set(r) for r in records if r["state"] != "EXECUTING"}

    only_here = {"exit", "exit_code", "feedback_not_shown"}
    told = schema(shown)
    assert only_here <= told["outcome SUCCEEDED"]
    told["outcome SUCCEEDED"] -= only_here
    assert told == schema(written)

    log.write_text(done.out)
    drawn = world.run("timeline", str(log), "--svg", str(tmp_path / "goals.svg"))
    assert (drawn.code, drawn.err) == (Exit.OK, "")
    assert drawn.out.startswith(f"/fibonacci ({FIBONACCI}, process ")
    assert "SUCCEEDED" in drawn.out
    assert drawn.out.splitlines()[-1].startswith("=> ok after ")


@pytest.mark.long
def test_retries_are_told_and_the_result_of_the_last_is_shown(world: World) -> None:
    world.server("error_code", codes="102,102,0", ends="succeeded")
    words = ("call", "error_code", NESTED, "--retries", "2")
    done = world.run(*words, "--transient", "nested_field.int32_value=102", "--ok",
                     "nested_field.int32_value=0")  # fmt: skip
    assert done.code == Exit.OK, done.err
    assert done.out.count("Trying again:") == 2
    assert "Sending goal (attempt 3):" in done.out
    assert "int32_value: 0" in done.out.rpartition("Result:")[2]


@pytest.mark.long
def test_a_result_that_lacks_the_field_is_no_success(world: World) -> None:
    world.server("fibonacci")
    words = ("call", "fibonacci", FIBONACCI, "{order: 3}", "--retries", "2")
    done = world.run(*words, "--ok", "sequence[9]=5")
    assert done.code == Exit.JUDGED, done.err
    assert "there is no element 9 in an array of 4" in done.err
    assert "Traceback" not in done.err + done.out
    assert "Trying again:" not in done.out


@pytest.mark.long
def test_now_is_the_present_time(world: World) -> None:
    world.server("navigate")
    goal = "{nested_different_pkg: now, nested_field: {float64_value: -1.0}}"
    done = world.run("call", "navigate", NESTED, goal)
    assert done.code == Exit.REJECTED, done.err
    found = re.search(r"nested_different_pkg:\n\s+sec: (\d+)", done.out)
    assert found, done.out
    assert int(found[1]) > 1_600_000_000


@pytest.mark.long
def test_progress_is_told_in_lines_where_there_is_no_terminal(world: World) -> None:
    world.server("navigate")
    done = world.run(
        "call", "navigate", NESTED, "{nested_field: {float64_value: 2.0}}",
        "--progress", "nested_field.float64_value:remaining",
    )  # fmt: skip
    assert done.code == Exit.OK, done.err
    shares = [int(share) for share in re.findall(r"^Progress: +(\d+)%", done.err, re.M)]
    assert len(shares) >= 2
    assert shares == sorted(shares)
    assert "Progress" not in done.out  # which is what `ros2 action send_goal` writes

"""Wrong usage, help, completion and documentation. Contract C6.3."""

from __future__ import annotations

import importlib.util
import os
import re
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from click.testing import CliRunner

from actionkit.cli._app import app
from actionkit.cli._shared.exits import Exit
from actionkit.cli._shared.say import say
from tests import forked
from tests.cli.conftest import FIBONACCI, NESTED, Done, World

DOCS = Path(__file__).parents[2] / "docs" / "command-line.md"
COMMANDS = (
    "call",
    "show",
    "list",
    "info",
    "watch",
    "attach",
    "cancel",
    "stop",
    "guard",
    "leftovers",
    "serve",
    "doctor",
    "timeline",
    "stubs",
    "interfaces",
    "mcp",
    "demo",
)
CALL = ("call", "/fibonacci", FIBONACCI)


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ((), "Usage:"),
        (("cal",), "No such command 'cal'. Did you mean 'call'"),
        (("clal",), "No such command 'clal'. Did you mean 'call'"),
        (("send-goal",), "No such command 'send-goal'. Did you mean 'send_goal'?"),
        (("frobnicate",), "No such command 'frobnicate'. There are: call, show, list,"),
        (("send_goal",), "Usage: actionkit call"),
        (("serve",), "Missing argument 'SERVER'"),
        (("call",), "Missing argument 'NAME'"),
        ((*CALL, "{order: 5}", "--fedback"), "No such option"),
        ((*CALL, "{order: 5}", "--stdin"), "not both"),
        ((*CALL, "{order: five}"), "order: 'five' is of type str"),
        ((*CALL, "{order: 99999999999}"), "order: 99999999999"),
        ((*CALL, "[1, 2]"), "not a mapping"),
        ((*CALL, "{order: 5}", "5", "f"), "What is '5 f' behind GOAL?"),
        ((*CALL, "["), "neither YAML nor JSON"),
        ((*CALL, "[" * 100_000), "nested too deeply"),
        ((*CALL, ""), "Give {} for a goal with all defaults"),
        ((*CALL, "~"), "Give {} for a goal with all defaults"),
        ((*CALL, "null"), "Give {} for a goal with all defaults"),
        ((*CALL, "--stdin"), "Give {} for a goal with all defaults"),
        ((*CALL, "{order: [}"), "neither YAML nor JSON"),
        ((*CALL, "--timeout", "soon"), "'soon' is not a number of seconds"),
        ((*CALL, "--timeout", "-1"), "zero or more"),
        ((*CALL, "--timeout", "nan"), "zero or more"),
        ((*CALL, "--timeout", "inf"), "1e9 or less"),
        ((*CALL, "--timeout", "1e300"), "1e9 or less"),
        ((*CALL, "--cancel-timeout", "1e300"), "1e9 or less"),
        ((*CALL, "--retries", "-1"), "--retries"),
        ((*CALL, "--ok", "sequence"), "not of the form"),
        ((*CALL, "--ok", "code=1"), "'code' is no field"),
        ((*CALL, "--ok", "a=1", "--transient", "b=2"), "about the same field"),
        ((*CALL, "--progress", "percent"), "percent' is no field"),
        ((*CALL, "--progress", "sequence:fast"), "'fast' must be"),
        (("call", "not a name", FIBONACCI), "not a valid ROS name"),
        (("call", "/fibonacci", "Fibonacci"), "is not an action type"),
        (("call", "/fibonacci", "test_msgs/action/Fibonaci"), f"Did you mean {FIBONACCI}?"),
        (("call", "/fibonacci", "tests_msgs/action/Fibonacci"), f"Did you mean {FIBONACCI}?"),
        (("call", "/fibonacci", "json/action/Fibonacci"), "'json' has no actions"),
        (
            ("call", "/dock", "dock_msgs/action/Dock"),
            "'dock_msgs' is not installed here. If it is in a workspace of yours, source that:"
            " `source install/setup.bash`. Or build it from its source with `actionkit",
        ),
        (("call", "/d", "shape_msgs/action/Dock"), "`pip install ros-jazzy-shape-msgs`"),
        (
            ("call", "/n", "nav2_msgs/action/Dock"),
            "(https://github.com/ros-navigation/navigation2)",
        ),
        (("watch", "/fibonacci", "--once", "--for", "1"), "not both"),
        (("watch", "--once", "--feedback"), "not both"),
        (("watch", "--log", "/dev/null/goals.jsonl"), "Not a directory"),
        (("info", "not a name"), "not a valid ROS name"),
        (("show", "test_msgs/action/Fibonaci"), f"Did you mean {FIBONACCI}?"),
        (("cancel", "/fibonacci", "7"), "'7' is not a goal id"),
        (("cancel", "/fibonacci", "0" * 32), "--all cancels all goals"),
        (("cancel", "/fibonacci", "0" * 31 + "1", "--all"), "not both"),
    ],
)
@pytest.mark.every
def test_wrong_usage(words: tuple[str, ...], told: str, ros_domain: int) -> None:
    from actionkit.cli._app import run

    runner = CliRunner()

    # The command's own way to report, rather than click's.
    import click

    @click.command(context_settings={"ignore_unknown_options": True, "help_option_names": []})
    @click.argument("rest", nargs=-1, type=click.UNPROCESSED)
    def through(rest: tuple[str, ...]) -> None:
        sys.exit(run(rest))

    result = runner.invoke(through, ["--", *words])
    assert result.exit_code == Exit.USAGE, result.output
    assert told in " ".join(result.output.split())
    assert "Traceback" not in result.output


@pytest.mark.long
@pytest.mark.parametrize("command", COMMANDS)
def test_help_has_examples_and_needs_no_ros(command: str) -> None:
    code = (
        f"import sys; sys.modules['rclpy'] = None; sys.modules['test_msgs'] = None\n"
        f"from actionkit.cli import main; main(['{command}', '--help'])"
    )
    done = forked.run(
        [sys.executable, "-W", "error", "-c", code], capture_output=True, text=True, timeout=30,
        check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith(f"Usage: actionkit {command}")
    assert command == "demo" or f"actionkit {command} " in done.stdout.partition("Examples:")[2]


def test_the_group_names_every_command() -> None:
    shown = CliRunner().invoke(app, ["--help"]).output
    assert re.findall(r"^  (\w+)  ", shown.partition("Commands:")[2], re.M) == list(COMMANDS)


@pytest.fixture(scope="module")
def without_ros(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Done]:
    """Return the command line of a Python that has ActionKit and what it depends on, but no ROS."""
    place = tmp_path_factory.mktemp("site")
    for name in ("actionkit", "click", "rich", "pygments", "yaml", "tenacity", "typing_extensions"):
        spec = importlib.util.find_spec(name)
        assert spec is not None
        assert spec.origin is not None
        source = Path(spec.origin)
        source = source.parent if source.name == "__init__.py" else source
        (place / source.name).symlink_to(source)

    def run(*words: str) -> Done:
        done = forked.run(
            # -S: nothing of this Python's site-packages
            [sys.executable, "-S", "-c", "from actionkit.cli import main; main()", *words],
            env={"PYTHONPATH": str(place), "PATH": os.environ["PATH"]},
            capture_output=True, text=True, timeout=60, check=False,
        )  # fmt: skip
        return Done(done.returncode, done.stdout, done.stderr)

    return run


@pytest.mark.long
def test_without_ros_every_command_says_what_to_install(without_ros: Callable[..., Done]) -> None:
    told = set()
    for words in (
        ("list",),
        ("info", "/a"),
        ("watch", "/a"),
        ("cancel", "/a"),
        CALL,
        ("serve", "silent"),
        ("demo",),
    ):
        done = without_ros(*words)
        assert (done.code, done.out) == (Exit.NO_ROS, ""), (words, done.err)
        told.add(done.err)
    (text,) = told
    assert text.startswith("Error: rclpy cannot be imported here")
    assert "source its setup file" in text
    assert "pip install 'ros-jazzy-rclpy[fastrtps]'" in text
    assert without_ros("doctor").code == Exit.NO_ROS
    assert without_ros("serve", "--list").code == Exit.OK


@pytest.mark.long
def test_without_the_messages_of_the_reference_servers(empty_world: World) -> None:
    for words in (("serve", "fibonacci"), ("demo",)):
        done = empty_world.run_apart(*words, before="import sys; sys.modules['test_msgs'] = None")
        assert done.code == Exit.NO_ROS, (words, done.err)
        assert done.err.startswith("Error: test_msgs cannot be imported here")
        assert "ros-jazzy-test-msgs" in done.err
        assert "pip install ros-jazzy-test-msgs" in done.err


@pytest.mark.long
def test_debug_shows_where_an_error_comes_from(empty_world: World) -> None:
    code = (
        "import sys; sys.modules['rclpy'] = None\n"
        "from actionkit.cli import main; main(['--debug', 'list'])"
    )
    done = forked.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=30, check=False
    )
    assert done.returncode == Exit.NO_ROS
    assert "Traceback (most recent call last)" in done.stderr
    assert "import_ros" in done.stderr


def test_an_error_that_nobody_thought_of_is_one_line(empty_world: World) -> None:
    broken = (
        "import actionkit._ros.others_goals.survey as s; s.Survey.settled = lambda *a, **k: 1 / 0"
    )
    done = empty_world.run_apart("list", before=broken)
    assert done.code == Exit.FAILED
    assert done.err.splitlines() == [
        "Error: ZeroDivisionError: division by zero",
        "The same command with --debug shows where it comes from.",
    ]


@pytest.mark.long
def test_options_may_come_from_the_environment(empty_world: World) -> None:
    done = empty_world.run_apart(*CALL, ACTIONKIT_CALL_SERVER_TIMEOUT="0.2")
    assert done.code == Exit.NO_SERVER
    assert re.search(r"after [0-4]\.\d s of looking", done.err)  # and not the usual 5


def test_an_output_that_cannot_be_written_is_told(empty_world: World) -> None:
    full = "import os; os.dup2(os.open('/dev/full', os.O_WRONLY), 1)"
    done = empty_world.run_apart("show", FIBONACCI, before=full)
    told = "Error: standard output cannot be written (No space left on device).\n"
    assert (done.code, done.err) == (Exit.OUTPUT_CLOSED, told)


@pytest.mark.long
def test_what_libraries_write_to_standard_output_is_not_in_it(empty_world: World) -> None:
    """Fast DDS does, where something is wrong."""
    noisy = (
        "import os, actionkit._ros.others_goals.survey as s; real = s.Survey.settled\n"
        "def settled(*a, **k): os.write(1, b'noise\\n'); return real(*a, **k)\n"
        "s.Survey.settled = settled"
    )
    done = empty_world.run_apart("list", "-c", before=noisy)
    assert (done.code, done.out, done.err) == (Exit.OK, "0\n", "noise\n")


# --- completion --------------------------------------------------------------------------------


def completions(world: World, words: str, shell: str = "bash") -> list[str]:
    """Ask as the shell does when Tab is pressed; the last word is the one to complete."""
    done = world.run_apart(
        _ACTIONKIT_COMPLETE=f"{shell}_complete",
        COMP_WORDS=words,
        COMP_CWORD=str(len(words.split(" ")) - 1),
    )
    assert done.err == ""
    return [line.partition(",")[2] for line in done.out.splitlines()]


@pytest.mark.long
def test_tab_completes_commands_names_types_servers_and_options(world: World) -> None:
    world.server("fibonacci")
    assert completions(world, "actionkit d") == ["doctor", "demo"]
    assert completions(world, "actionkit call /fib") == ["/fibonacci"]
    assert completions(world, "actionkit call /fibonacci test_msgs/") == [FIBONACCI, NESTED]
    assert completions(world, "actionkit serve fibo") == ["fibonacci"]
    assert "--feedback" in completions(world, "actionkit call --fee")


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_each_shell_is_given_its_script(empty_world: World, shell: str) -> None:
    done = empty_world.run_apart(_ACTIONKIT_COMPLETE=f"{shell}_source")
    assert done.code == 0, done.err
    assert "_ACTIONKIT_COMPLETE" in done.out
    assert f"_ACTIONKIT_COMPLETE={shell}_source actionkit" in DOCS.read_text("utf-8")


# --- documentation -----------------------------------------------------------------------------


def test_the_documented_exit_codes_are_the_real_ones() -> None:
    rows = re.findall(r"^\| (\d+) \| `(\w+)` \| (.*) \|$", DOCS.read_text("utf-8"), re.M)
    assert rows == [(str(code.value), code.name, code.meaning.replace("|", "\\|")) for code in Exit]


def test_a_narrow_terminal_breaks_no_word(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "40")
    help_text = CliRunner().invoke(app, ["call", "--help"], terminal_width=40).output
    codes = help_text.partition("Exit codes:\n")[2]
    assert max(map(len, codes.splitlines())) <= 40
    assert "\n         --feedback-timeout seconds; the\n" in codes
    error = f"Error: {FIBONACCI} is an action type. Write: actionkit call /fibonacci '{{order: 5}}'"
    say(error, err=True)
    assert capsys.readouterr().err == f"{error}\n"  # one line for programs
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    say(error, err=True)
    *said, command = capsys.readouterr().err.splitlines()
    assert said == [f"Error: {FIBONACCI} is an", "action type. Write:"]
    assert command == "actionkit call /fibonacci '{order: 5}'"  # to be copied


def test_every_capture_is_linked_from_the_documentation() -> None:
    text = DOCS.read_text("utf-8")
    for path in DOCS.parent.glob("captures/*"):
        assert f"captures/{path.name}" in text, path.name
    for name in re.findall(r"\((captures/[^)]+)\)", text):
        assert (DOCS.parent / name).is_file(), name


def test_every_option_is_documented() -> None:
    text = DOCS.read_text("utf-8")
    context = app.make_context("actionkit", [], resilient_parsing=True)
    for name in COMMANDS:
        command = app.get_command(context, name)
        assert command is not None
        for parameter in command.params:
            for word in parameter.opts:
                if word.startswith("--") and word != "--help":
                    assert f"`{word}" in text, f"{name} {word}"


def test_what_an_interrupt_leaves_half_made_is_no_traceback() -> None:
    # As asyncio's event loop, where Ctrl-C comes while it is being made.
    program = """
import actionkit.cli._app as app
from actionkit.cli import main
class Half:
    def __init__(self, coroutine):
        raise KeyboardInterrupt
    def __del__(self):
        self.what_init_would_have_made
async def never_awaited(): ...
app.run = lambda arguments: Half(never_awaited())
main([])
"""
    done = forked.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=False
    )
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "\nInterrupted.\n")


def test_ctrl_c_in_a_task_prints_no_traceback() -> None:
    """asyncio tells of the task that got it, too."""
    program = """
import asyncio, os, signal
import actionkit.cli._app as app
from actionkit.cli import main
from actionkit.cli._shared import early
async def is_interrupted():
    os.kill(os.getpid(), signal.SIGINT)
async def run():
    task = asyncio.create_task(is_interrupted())
    await asyncio.sleep(60)
def command(arguments):
    with early.remembered():
        asyncio.run(run())
app.run = command
main([])
"""
    done = forked.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=False
    )
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "\nInterrupted.\n")

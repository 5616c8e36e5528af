"""Foreign texts, in names, messages and errors, are escaped on a terminal."""

from __future__ import annotations

import ast
import logging
import re
from collections.abc import Callable
from pathlib import Path

import pytest
from rich.console import Console
from test_msgs.action import Fibonacci

from actionkit import cli
from actionkit._ros.others_goals.goal_board import Board
from actionkit._ros.others_goals.watch import GoalSeen
from actionkit.cli._shared import options as _options
from actionkit.cli._shared.exits import Exit
from actionkit.cli._shared.say import say
from actionkit.cli.call import _reports
from actionkit.cli.call._live import LiveReport
from actionkit.cli.demo._screen import DemoScreen
from actionkit.cli.watch._screens import TableScreen, Watched
from tests.cli.conftest import FIBONACCI, World

HOSTILE = "\x1b]0;owned\x07\x1b[2J\x9b31m\x7f\r\u202e\ud800"
"""Sets the title, clears the screen, turns the text round; and half a character."""
ESCAPED = r"\u001b]0;owned\u0007\u001b[2J\u009b31m\u007f\r\u202e\ud800"
CONTROLS = set(HOSTILE) - set(ESCAPED)


def drawn_table(name: str, server: str, text: str) -> None:
    board = Board()
    board.take((server,), 0.0)
    board.take([GoalSeen("", "EXECUTING", 1)], 0.0)
    action, screen = Watched(name, board), TableScreen(feedback=True)
    screen.goal(action, board.sorted()[0], {"text": text})
    Console(width=400).print(screen._drawn([action], (), 1.0))


def log() -> None:
    handler = logging.StreamHandler()
    handler.setFormatter(_options._Printable("%(message)s"))
    handler.handle(logging.LogRecord("actionkit", logging.DEBUG, "", 0, "%s", (HOSTILE,), None))


WAYS_OUT = {
    "_shared/say": ["click.echo"],
    "call/_live": ["Console"],
    "demo/_screen": ["Console"],
    "watch/_screens": ["Console"],
    "_shared/options": ["logging.StreamHandler"],
}
"""Where the command line writes texts, and by what."""
OWN_WORDS = {
    "__init__": ["print"],
    "call/_calling": ["print"],
    "demo/_steps": ["print"] * 9,  # which is handed to each step, and is `DemoScreen.said`
    "cancel_and_stop/_keeper": ["print"],
    "_shared/signals": ["os.write"] * 2,
    "interfaces/interfaces": ["Console"],  # the names of packages, which were checked
    "timeline": ["sys.stdout.write"],  # a picture: test_picture.py
}
"""Where it writes nothing that others wrote."""
WRITES = re.compile(
    r"(click\.)?(echo\w*|secho|style_and_echo)|print|sys\.std(out|err)\.write\w*|os\.write"
    r"|([\w.]+\.)?(Console|StreamHandler)|traceback\.print_\w+"
)


@pytest.mark.parametrize(
    "write",
    [
        lambda: say(HOSTILE),
        lambda: say(HOSTILE, err=True, label="ours"),
        lambda: LiveReport(Fibonacci.Goal(), bar=False).out(HOSTILE),
        lambda: DemoScreen(Console(width=400, markup=False)).failure(HOSTILE),
        lambda: drawn_table(HOSTILE, "/b", "c"),
        lambda: drawn_table("/a", HOSTILE, "c"),
        lambda: drawn_table("/a", "/b", HOSTILE),
        log,
    ],
    ids=["say", "error", "live", "demo", "action", "server", "feedback", "log"],
)
def test_a_text_cannot_control_the_terminal(
    write: Callable[[], object], capsys: pytest.CaptureFixture[str]
) -> None:
    write()
    captured = capsys.readouterr()
    text = captured.out + captured.err
    assert text.count(ESCAPED) == 1
    assert not CONTROLS & set(text)
    text.encode()


@pytest.mark.long
def test_there_is_no_other_way_out() -> None:
    found = {}
    folder = Path(cli.__file__).parent
    for path in folder.rglob("*.py"):
        tree = ast.parse(path.read_text("utf-8"))
        calls = (ast.unparse(node.func) for node in ast.walk(tree) if isinstance(node, ast.Call))
        if writes := [call for call in calls if WRITES.fullmatch(call)]:
            found[path.relative_to(folder).with_suffix("").as_posix()] = writes
    assert found == WAYS_OUT | OWN_WORDS


def test_a_call_whose_messages_are_hostile(world: World, monkeypatch: pytest.MonkeyPatch) -> None:
    world.server("fibonacci")
    # No installed action has a field of text.
    monkeypatch.setattr(_reports, "as_yaml", lambda _: HOSTILE)
    done = world.run("call", "fibonacci", FIBONACCI, "{order: 3}")
    assert done.code == Exit.OK
    assert done.out.count(ESCAPED) == 2  # the goal and its result
    assert not CONTROLS & set(done.out + done.err)

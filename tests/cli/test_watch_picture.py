"""The table of `actionkit watch` in the guide: what a recording's status messages show (C6.3).

With ACTIONKIT_WRITE_PICTURES=1 in the environment the picture is written.
"""

from __future__ import annotations

import io
import os
import re

from rich.console import Console

from actionkit._ros.answers.wire import goals
from actionkit._ros.others_goals.goal_board import Board
from actionkit._ros.others_goals.watch import _seen
from actionkit.cli.watch._screens import TableScreen, Watched
from tests.docs.snippets import ROOT
from tests.recordings import bags

PICTURE = ROOT / "docs" / "pictures" / "watch.svg"
WIDTH = 74


def test_the_table_of_the_guide() -> None:
    actions: dict[str, Watched] = {}
    messages = [m for m in bags.night() if m.topic.endswith("/status")]
    both_run = next(n for n, m in enumerate(messages) if len(list(goals(m.data))) == 4)
    for message in messages[: both_run + 2]:
        name = message.topic.removesuffix("/_action/status")
        action = actions.setdefault(name, Watched(name, Board(apart=True)))
        action.board.servers = ("/robot",)
        action.board.take([_seen(*goal) for goal in goals(message.data)], message.stamp * 1e-9)
    now = messages[both_run + 1].stamp * 1e-9 + 0.3
    console = Console(record=True, file=io.StringIO(), width=WIDTH, height=20, force_terminal=True)
    screen = TableScreen()
    screen._console = console
    console.print(screen._drawn(list(actions.values()), (), now))
    svg = console.export_svg(title="actionkit watch", unique_id="watch")
    svg = re.sub(r"@font-face \{.*?\}\s*", "", svg, flags=re.S)
    if os.environ.get("ACTIONKIT_WRITE_PICTURES") == "1":
        PICTURE.write_text(svg)
    assert svg == PICTURE.read_text()
    assert svg.count("/move_arm") == 4

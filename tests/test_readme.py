"""The README is true: its commands are those of CI, and its outputs are real."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

from tests import forked
from tests.docs.snippets import Block, blocks
from tests.docs.test_pages import DOCS

ROOT = Path(__file__).resolve().parent.parent
README = ROOT / "README.md"


def fences(language: str, page: Path = README) -> list[Block]:
    return [block for block in blocks(page) if block.language == language]


def test_the_example_is_short() -> None:
    # `tests/docs/test_pages.py` runs it.
    (example,) = fences("python")
    assert len([line for line in example.text.splitlines() if line.strip()]) <= 10


def test_the_server_of_the_tour(ros_domain: int) -> None:
    (block,) = [each for each in fences("", DOCS / "client.md") if "actionkit.servers" in each.text]
    words = block.text.split()
    assert words[0] == ".venv/bin/python"
    with forked.Popen(
        [sys.executable, *words[1:]], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        # Fast DDS, too, writes there.
        assert any('"ready"' in line for line in process.stdout)
        process.terminate()


def test_the_commands_are_two_and_ci_runs_the_tests_with_the_second() -> None:
    demo, tests = (block.text.strip() for block in fences("sh"))
    assert "\n" not in demo
    assert "\n" not in tests
    assert demo.endswith("&& .venv/bin/actionkit demo")
    assert tests.endswith("&& .venv/bin/pytest")
    commands = [line.strip() for line in (ROOT / ".ci" / "run").read_text().splitlines()]
    assert f'tests="{tests}"' in commands


def test_what_a_call_looks_like_is_a_picture_that_the_tests_draw() -> None:
    # `tests/cli/test_terminal.py` does.
    for page in (README, DOCS / "index.md"):
        (picture,) = re.findall(r"!\[[^]]+\]\((\S*captures\S*)\)", page.read_text())
        assert (page.parent / picture).resolve() == DOCS / "captures" / "call-terminal.svg"


def test_the_tree_of_errors_is_the_real_one() -> None:
    import actionkit

    (tree,) = [
        block.text
        for block in fences("", DOCS / "client.md")
        if block.text.startswith("ActionKitError")
    ]
    parents = ["Exception"]
    for line in tree.splitlines():
        found = re.match(r"([│├└─ ]*)(\w+Error)\b", line)
        assert found, line
        depth = len(found[1]) // 3 + 1
        error = getattr(actionkit, found[2])
        assert parents[depth - 1] in [base.__name__ for base in error.__bases__]
        parents[depth:] = [found[2]]
    shown = set(re.findall(r"\w+Error\b", tree))
    assert shown == {name for name in actionkit.__all__ if name.endswith("Error")}

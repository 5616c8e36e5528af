"""The README is true: its snippets run and print what it says, its commands are those of CI.

A comment `# -> text` in a snippet is what its line prints. In `# ... text ...` the dots stand for
anything. Run as a script, this file executes the snippets given on stdin.
"""

from __future__ import annotations

import builtins
import re
import subprocess
import sys
from pathlib import Path
from types import FrameType
from typing import Any

from actionkit import servers

ROOT = Path(__file__).resolve().parent.parent
README = ROOT / "README.md"
EXPECTED = re.compile(r"  # (?:-> (?P<all>.*)|\.\.\. (?P<part>.*) \.\.\.)$")


def fences(language: str) -> list[tuple[int, str]]:
    """The code blocks of a language, each with the number of its first line."""
    text = README.read_text()
    blocks = re.finditer(r"^```(\w*)\n(.*?)^```$", text, re.M | re.S)
    return [
        (text.count("\n", 0, block.start(2)) + 1, block[2])
        for block in blocks
        if block[1] == language
    ]


def script(blocks: list[tuple[int, str]]) -> str:
    """The blocks at the lines where they are in the README, so that tracebacks tell them."""
    lines = [""] * len(README.read_text().splitlines())
    for number, block in blocks:
        lines[number - 1 : number - 1 + block.count("\n")] = block.splitlines()
    return "\n".join(lines) + "\n"


def unnoisy(text: str) -> str:
    # Not at the top: as a script in another folder this file cannot import from tests.
    from tests.conftest import without_noise

    return without_noise(text)


def execute(blocks: list[tuple[int, str]], folder: Path) -> None:
    """Run blocks as one program in a process of its own, in a folder for what it writes."""
    done = subprocess.run(
        [sys.executable, __file__],
        input=script(blocks),
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert unnoisy(done.stderr) == ""


def test_the_first_example(ros_domain: int, tmp_path: Path) -> None:
    execute(fences("python")[:1], tmp_path)


def test_the_first_example_is_ten_lines() -> None:
    code = fences("python")[0][1]
    assert len([line for line in code.splitlines() if line.strip()]) <= 10


def test_the_tour(ros_domain: int, tmp_path: Path) -> None:
    # Quicker than the server that the tour starts: the tests need not see the feedback come.
    with servers.start("fibonacci", domain_id=ros_domain, period=0.02):
        execute(fences("python")[1:], tmp_path)


def test_the_server_of_the_tour(ros_domain: int) -> None:
    (block,) = [text for _, text in fences("") if "actionkit.servers" in text]
    words = block.split()
    assert words[0] == ".venv/bin/python"
    with subprocess.Popen(
        [sys.executable, *words[1:]], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert '"ready"' in next(line for line in process.stdout if unnoisy(line))
        process.terminate()


def test_the_commands_are_two_and_ci_runs_the_tests_with_the_second() -> None:
    demo, tests = (block.strip() for _, block in fences("sh"))
    assert "\n" not in demo
    assert "\n" not in tests
    assert demo.endswith("&& .venv/bin/actionkit demo")
    assert tests.endswith("&& .venv/bin/pytest")
    commands = [line.strip() for line in (ROOT / ".ci" / "run").read_text().splitlines()]
    assert f'tests="{tests}"' in commands


def test_the_tree_of_errors_is_the_real_one() -> None:
    import actionkit

    (tree,) = [block for _, block in fences("") if block.startswith("ActionKitError")]
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


def _matches(expected: re.Match[str], printed: str) -> bool:
    if expected["all"] is not None:
        return printed == expected["all"]
    return expected["part"] in printed


def main() -> None:
    """Execute the program on stdin and check what it prints."""
    source = sys.stdin.read()
    lines = source.splitlines()
    wanted = {n: found for n, line in enumerate(lines, 1) if (found := EXPECTED.search(line))}
    real_print = builtins.print

    def checking_print(*values: Any, **options: Any) -> None:
        frame: FrameType = sys._getframe(1)
        text = " ".join(str(value) for value in values)
        if frame.f_code.co_filename == str(README) and frame.f_lineno in wanted:
            expected = wanted.pop(frame.f_lineno)
            if not _matches(expected, text):
                sys.exit(f"README.md:{frame.f_lineno} printed {text!r}, not {expected[0]!r}")
        real_print(*values, **options)

    builtins.print = checking_print
    exec(compile(source, str(README), "exec"), {"__name__": "__main__"})
    if wanted:
        sys.exit(f"nothing was printed at these lines of README.md: {sorted(wanted)}")


if __name__ == "__main__":
    main()

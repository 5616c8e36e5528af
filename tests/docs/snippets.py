"""Runs the code blocks of a page of the documentation, and checks what they print.

A comment `# -> text` in a Python block is what its line prints. In `# ... text ...` the dots stand
for anything. All Python blocks of a page are one program, in the order of the page. A comment above
a block, which readers of the page do not see, says what else it is:

- `<!-- not run: REASON -->`: not run, only compiled where it is Python
- `<!-- file: NAME -->`: written to a file of that name, in the folder where everything runs
- `<!-- another program -->`: this and the following Python blocks are a program of their own
- `<!-- exit code: N -->`: of a shell block, in place of 0
- `<!-- prints: TEXT -->`: what the output of a shell block has in it
- `<!-- in the background -->`: a shell block that goes on, until the page has been run

Files are written first, then the blocks run in the order of the page; a Python program runs where
its last block stands. Run as a script, this file executes the program on stdin, whose lines stand
where they are in the page.
"""

from __future__ import annotations

import builtins
import os
import re
import signal
import subprocess
import sys
import traceback
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Any, NoReturn

ROOT = Path(__file__).resolve().parent.parent.parent
_EXPECTED = re.compile(r"  # (?:-> (?P<all>.*)|\.\.\. (?P<part>.*) \.\.\.)$")
_FENCE = re.compile(
    r"(?:^[ ]*<!-- (?P<mark>[^>]*?) -->\n\n?)?"
    r"^(?P<indent>[ ]*)```(?P<language>\w*)[^\n]*\n(?P<text>.*?)^(?P=indent)```$",
    re.M | re.S,
)
_MARKS = re.compile(
    r"not run: .+|file: \S+|another program|exit code: \d+|in the background|prints: .+"
)
_SHELL = ("sh", "bash")
_LIMIT = 120
"""Seconds for one program of a page; each takes a few."""


@dataclass(frozen=True)
class Block:
    """A code block of a page."""

    language: str
    line: int
    """The number of its first line."""
    text: str
    mark: str
    """The text of the comment above it."""


def blocks(page: Path) -> list[Block]:
    """Return the code blocks of a page."""
    text = page.read_text()
    found = []
    for match in _FENCE.finditer(text):
        mark = match["mark"] or ""
        body = re.sub(rf"^{match['indent']}", "", match["text"], flags=re.M)
        if mark and not _MARKS.fullmatch(mark):
            mark = ""  # a comment that is about something else
        line = text.count("\n", 0, match.start("text")) + 1
        found.append(Block(match["language"], line, body, mark))
    return found


def run_page(page: Path, folder: Path, python: Path = Path(sys.executable)) -> None:
    """Run all blocks of a page, in this folder, with this interpreter and its commands.

    Raises:
        AssertionError: One fails, or prints something else than the page says.
    """
    steps = list(_steps(page, folder))
    with ExitStack() as running:
        for step in steps:
            if isinstance(step, list):
                run_python(page, step, folder, python)
            elif step.mark == "in the background":
                running.enter_context(_in_the_background(step.text, folder, python))
            else:
                _run_shell(page, step, folder, python)


def run_python(
    page: Path, program: list[Block], folder: Path, python: Path = Path(sys.executable)
) -> None:
    """Run Python blocks as one program in a process of its own."""
    lines = [""] * len(page.read_text().splitlines())
    for block in program:  # where they are in the page, so that tracebacks tell it
        lines[block.line - 1 : block.line - 1 + block.text.count("\n")] = block.text.splitlines()
    from tests import forked  # not where this file is the program

    done = forked.run(
        [str(python), __file__, str(page)],
        input="\n".join(lines) + "\n",
        cwd=folder,
        env=_environment(python),
        capture_output=True,
        text=True,
        timeout=_LIMIT,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert _without_noise(done.stderr) == "", done.stderr


def _steps(page: Path, folder: Path) -> Iterator[Block | list[Block]]:
    programs: list[list[Block]] = [[]]
    order: list[Block | list[Block]] = []
    for block in blocks(page):
        if block.mark.startswith("not run"):
            if block.language == "python":
                compile(block.text, f"{page}:{block.line}", "exec")
        elif block.mark.startswith("file: "):
            target = folder / block.mark.removeprefix("file: ")
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_text(block.text)
        elif block.language == "python":
            if block.mark == "another program":
                programs.append([])
            program = programs[-1]
            program.append(block)
            order = [step for step in order if step is not program]
            order.append(program)
        elif block.language in _SHELL:
            order.append(block)
    return iter(order)


def _environment(python: Path) -> dict[str, str]:
    kept = dict(os.environ)
    if python != Path(sys.executable):
        # ROS from PyPI sets these for the environment of this interpreter.
        for name in ("_ROS_WHEELS_BOOTSTRAP_COMPLETE", "LD_LIBRARY_PATH", "PYTHONPATH"):
            kept.pop(name, None)
    return kept | {"PATH": f"{python.parent}{os.pathsep}{os.environ['PATH']}"}


def _run_shell(page: Path, block: Block, folder: Path, python: Path) -> None:
    done = subprocess.run(
        ["bash", "-euo", "pipefail", "-c", block.text],
        stdin=subprocess.DEVNULL,
        cwd=folder,
        env=_environment(python),
        capture_output=True,
        text=True,
        timeout=_LIMIT,
        check=False,
    )
    kind, _, text = block.mark.partition(": ")
    said = f"{page}:{block.line}\n{done.stdout}{done.stderr}"
    assert done.returncode == (int(text) if kind == "exit code" else 0), said
    assert kind != "prints" or text in _without_noise(done.stdout + done.stderr), said


@contextmanager
def _in_the_background(text: str, folder: Path, python: Path) -> Iterator[None]:
    with subprocess.Popen(
        ["bash", "-c", f"exec {text.strip()}"],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        cwd=folder,
        env=_environment(python),
    ) as process:
        try:
            yield
            assert process.poll() is None, f"ended by itself: {text}"
        finally:
            process.send_signal(signal.SIGTERM)


def _without_noise(text: str) -> str:
    # Not at the top: as a script in another folder this file cannot import from tests.
    from tests.conftest import without_noise

    lines = without_noise(text).splitlines(keepends=True)
    return "".join(line for line in lines if not line.startswith("[INFO] ["))  # of ROS nodes


def _matches(expected: re.Match[str], printed: str) -> bool:
    if expected["all"] is not None:
        return printed == expected["all"]
    return expected["part"] in printed


def _fail(text: str) -> NoReturn:
    # Not sys.exit: a thread that spins an executor would keep the process.
    sys.stderr.write(text)
    sys.stderr.flush()
    os._exit(1)


def main(page: str) -> None:
    """Execute the program on stdin and check what it prints."""
    source = sys.stdin.read()
    lines = source.splitlines()
    wanted = {n: found for n, line in enumerate(lines, 1) if (found := _EXPECTED.search(line))}
    real_print = builtins.print

    def checking_print(*values: Any, **options: Any) -> None:
        frame: FrameType = sys._getframe(1)
        text = " ".join(str(value) for value in values)
        if frame.f_code.co_filename == page and frame.f_lineno in wanted:
            expected = wanted.pop(frame.f_lineno)
            if not _matches(expected, text):
                _fail(f"{page}:{frame.f_lineno} printed {text!r}, not {expected[0]!r}")
        real_print(*values, **options)

    builtins.print = checking_print
    sys.path.insert(0, str(Path.cwd()))  # not the folder of this file
    try:
        exec(compile(source, page, "exec"), {"__name__": "__main__"})
    except Exception:  # noqa: BLE001  told, and the process ends
        _fail(traceback.format_exc())
    if wanted:
        _fail(f"nothing was printed at these lines of {page}: {sorted(wanted)}")


if __name__ == "__main__":
    main(sys.argv[1])

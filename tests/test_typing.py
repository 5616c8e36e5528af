"""The public types: right code has no errors, and wrong code is refused (STYLE 9).

The snippets are under `typing/`; mypy (strict) and pyright read them, nothing runs them.
"""

from __future__ import annotations

import importlib.util
import json
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
RIGHT = ROOT / "tests" / "typing" / "right.py"
WRONG = ROOT / "tests" / "typing" / "wrong.py"

Found = dict[str, dict[int, list[tuple[str, str]]]]
"""Name of the file -> line number -> (kind of the error, its text)."""


def mypy(files: list[Path], scratch: Path, root: Path = ROOT) -> Found:
    command = [
        *(sys.executable, "-m", "mypy", "--config-file", str(root / "pyproject.toml")),
        *("--cache-dir", str(scratch / "cache"), "--no-error-summary", "--no-pretty"),
        *map(str, files),
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=root)
    assert done.returncode in (0, 1), done.stdout + done.stderr
    found: Found = {file.name: {} for file in files}
    # What mypy has to say of the library itself is not this test's business
    for match in re.finditer(r"^(.*):(\d+): error: (.*)  \[([\w-]+)\]$", done.stdout, re.M):
        if root / match[1] in files:
            errors = found[Path(match[1]).name].setdefault(int(match[2]), [])
            errors.append((match[4], match[3]))
    return found


def pyright(files: list[Path], _scratch: Path, root: Path = ROOT) -> Found:
    # In the root, so that the settings of its pyproject.toml count
    command = [
        *(sys.executable, "-m", "pyright", "--outputjson", "--pythonpath", sys.executable),
        *map(str, files),
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=root)
    assert done.returncode in (0, 1), done.stdout + done.stderr
    report = json.loads(done.stdout[done.stdout.index("{") :])
    assert report["summary"]["filesAnalyzed"] == len(files), report
    found: Found = {file.name: {} for file in files}
    for error in report["generalDiagnostics"]:
        if error["severity"] == "error" and Path(error["file"]) in files:
            errors = found[Path(error["file"]).name]
            line = error["range"]["start"]["line"] + 1
            errors.setdefault(line, []).append((error.get("rule", "?"), error["message"]))
    return found


CHECKERS = pytest.mark.parametrize("check", [mypy, pyright], ids=lambda check: check.__name__)
Checker = Callable[..., Found]


@pytest.fixture(autouse=True)
def _skip_without_the_tool(request: pytest.FixtureRequest) -> None:
    name = request.getfixturevalue("check").__name__
    if importlib.util.find_spec(name) is None:
        pytest.skip(f"{name} is not installed; pip install {name}")


@pytest.mark.long  # `stubs/test_user_types.py` holds most of it
@CHECKERS
def test_right_code_is_clean_and_wrong_code_refused_where_it_is_wrong(
    check: Checker, tmp_path: Path
) -> None:
    found = check([RIGHT, WRONG], tmp_path)  # at once: most of the time goes for the library
    assert found["right.py"] == {}
    lines = WRONG.read_text().splitlines()
    expected = {
        number: set(re.findall(r"[\w-]+", match[1]))
        for number, line in enumerate(lines, 1)
        if (match := re.search(r"# error\[(.*?)\]", line))
    }
    assert len(expected) > 30
    wrong = found["wrong.py"]
    assert {line: wrong[line] for line in sorted(wrong.keys() - expected.keys())} == {}
    assert [lines[line - 1] for line in sorted(expected.keys() - wrong)] == []
    # For the reason that is meant, and not by chance
    for line, errors in wrong.items():
        assert {kind for kind, _ in errors} <= expected[line], (line, errors)


@pytest.mark.long
@CHECKERS
def test_actions_without_stubs_can_be_used(check: Checker, tmp_path: Path) -> None:
    (tmp_path / "pyproject.toml").write_text("[tool.mypy]\nstrict = true\n")
    file = tmp_path / "no_stubs.py"
    shutil.copy(ROOT / "tests" / "typing" / "no_stubs.py", file)
    assert check([file], tmp_path, tmp_path) == {"no_stubs.py": {}}

"""The command `python -m tests.mutants.generated`: mutmut changes each operator, name and call.

For the packages that decide without servers, and the tests of `tests/unit` (`[tool.mutmut]` in
`pyproject.toml`). It works on a copy, in `build/mutants`, as mutmut leaves decorated functions
alone: in the copy they are decorated after their definition. Needs `pip install -e '.[dev,hunt]'`.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import time
from dataclasses import dataclass
from fnmatch import fnmatch
from pathlib import Path

import click
import libcst as cst

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

from tests.mutants.slots import ROOT, listed_files

FOLDER = ROOT / "build" / "mutants"
SAME = Path(__file__).with_name("same.toml")
"""Mutants that are the same program, each with the reason."""
_NOTICED = {1, 3, 24, 36, -9, -11, -24, 152, 255}
"""Exit codes in mutmut's files: failed, too long, or crashed."""
_LEFT_ALONE = ("abstractmethod", "overload")


@dataclass
class Survivor:
    """A change that no test has noticed."""

    name: str
    path: str
    old: str
    new: str

    def is_same(self, known: dict[str, str]) -> bool:
        """Whether `known` lists this change."""
        change = self.path, self.old, self.new
        return change == (known["file"], known["old"], known.get("new", self.new))


class _Undecorate(cst.CSTTransformer):
    """Turns `@property def f` into `def f` and `f = property(f)`."""

    def leave_FunctionDef(
        self, original_node: cst.FunctionDef, updated_node: cst.FunctionDef
    ) -> cst.FunctionDef | cst.FlattenSentinel[cst.BaseStatement]:
        names = [
            d.decorator.value for d in updated_node.decorators if isinstance(d.decorator, cst.Name)
        ]
        if len(names) != 1 or len(updated_node.decorators) != 1 or names[0] in _LEFT_ALONE:
            return updated_node
        name = updated_node.name
        assignment = cst.Assign(
            [cst.AssignTarget(name)], cst.Call(cst.Name(names[0]), [cst.Arg(name)])
        )
        return cst.FlattenSentinel(
            [updated_node.with_changes(decorators=[]), cst.SimpleStatementLine([assignment])]
        )


def _settings() -> dict[str, list[str]]:
    with (ROOT / "pyproject.toml").open("rb") as file:
        return tomllib.load(file)["tool"]["mutmut"]


def _copy() -> None:
    """Bring the copy up to date; files that have not changed stay as they are, for mutmut."""
    patterns = _settings()["only_mutate"]
    for name in listed_files():
        source, target = ROOT / name, FOLDER / name
        if target.is_file() and target.stat().st_mtime >= source.stat().st_mtime:
            continue
        target.parent.mkdir(parents=True, exist_ok=True)
        if any(fnmatch(name, pattern) for pattern in patterns):
            text = cst.parse_module(source.read_text("utf-8")).visit(_Undecorate()).code
            target.write_text(text, "utf-8")
        else:
            shutil.copy2(source, target)


@dataclass
class Score:
    """How many mutants of a file were noticed."""

    path: str
    tried: int
    survivors: list[Survivor]
    same: int

    def __str__(self) -> str:
        noticed, left = self.tried - len(self.survivors) - self.same, len(self.survivors)
        share = noticed / (noticed + left) if noticed + left else 1.0
        return f"{self.path:28}{self.tried:7}  {noticed:7}  {self.same:8}  {left:4}  {share:6.1%}"


def _scores(known: list[dict[str, str]]) -> tuple[list[Score], list[dict[str, str]]]:
    """Return the score of each file, and those of `known` that were not met."""
    scores, met = [], []
    folder = FOLDER / "mutants" / "actionkit"
    for file in sorted(folder.rglob("*.meta")):
        codes = json.loads(file.read_text("utf-8"))["exit_code_by_key"]
        tried = {name: code for name, code in codes.items() if code is not None}
        score = Score(str(file.relative_to(folder).with_suffix("")), len(tried), [], 0)
        for name in (name for name, code in tried.items() if code not in _NOTICED):
            survivor = _survivor(name, score.path)
            same = [one for one in known if survivor.is_same(one)]
            met += same
            if same:
                score.same += 1
            else:
                score.survivors.append(survivor)
        scores += [score] if tried else []
    return scores, [one for one in known if one not in met]


def _survivor(name: str, path: str) -> Survivor:
    from mutmut.mutation.diff_apply import get_diff_for_mutant

    diff = get_diff_for_mutant(name, path=Path("actionkit") / path).splitlines()[2:]
    old, new = (
        "\n".join(line[1:].strip() for line in diff if line.startswith(sign)) for sign in "-+"
    )
    return Survivor(name, path, old, new)


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.argument("only", nargs=-1)
@click.option("--no-run", is_flag=True, help="Show what the last run has found.")
def main(only: tuple[str, ...], no_run: bool) -> None:
    """Change the code in every way mutmut knows, and count what the tests notice.

    ONLY is any number of mutmut's names of mutants, also with `*`; without one all are tried, from
    the beginning.
    """
    began = time.monotonic()
    if not no_run:
        if not only:
            shutil.rmtree(FOLDER, ignore_errors=True)
        _copy()
        mutmut = Path(sys.executable).with_name("mutmut")
        subprocess.run([mutmut, "run", *only], cwd=FOLDER, check=True)
    os.chdir(FOLDER)  # mutmut's functions look for its files there
    known = tomllib.loads(SAME.read_text("utf-8"))["same"]
    scores, unmet = _scores(known)
    for score in scores:
        for survivor in score.survivors:
            click.echo(f"\n{survivor.name}\n- {survivor.old}\n+ {survivor.new}")
    if not only:
        for same in unmet:
            click.echo(f"\nIn {SAME.name}, but noticed or gone: {same['file']}: {same['old']}")
    click.echo(f"\n{'':28}mutants  noticed  the same  left")
    for score in scores:
        click.echo(score)
    click.echo(f"{time.monotonic() - began:.0f} s")
    sys.exit(1 if any(score.survivors for score in scores) else 0)


if __name__ == "__main__":
    main()

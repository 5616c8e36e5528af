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
from collections import Counter, defaultdict
from collections.abc import Iterator
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
_SURVIVED, _NO_TESTS = 0, 33  # exit codes in mutmut's files
_LEFT_ALONE = ("abstractmethod", "overload")


@dataclass
class Survivor:
    """A change that no test has noticed."""

    name: str
    path: str
    old: str
    new: str

    def is_same(self, known: list[dict[str, str]]) -> bool:
        """Whether it is one of those that are known to be the same program."""
        return any(
            same["file"] == self.path
            and same["old"] == self.old
            and same.get("new", self.new) == self.new
            for same in known
        )


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
        again = cst.Assign([cst.AssignTarget(name)], cst.Call(cst.Name(names[0]), [cst.Arg(name)]))
        return cst.FlattenSentinel(
            [updated_node.with_changes(decorators=[]), cst.SimpleStatementLine([again])]
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


def _results() -> dict[str, dict[str, int | None]]:
    """Return for each file how the tests of each of its mutants have ended."""
    folder = FOLDER / "mutants" / "actionkit"
    return {
        str(path.relative_to(folder).with_suffix("")): json.loads(path.read_text("utf-8"))["exit_code_by_key"]
        for path in sorted(folder.rglob("*.meta"))
    }  # fmt: skip


def _survivors(names: list[str], path: str) -> Iterator[Survivor]:
    from mutmut.mutation.diff_apply import get_diff_for_mutant

    for name in names:
        diff = get_diff_for_mutant(name, path=Path("actionkit") / path).splitlines()[2:]
        old, new = (
            "\n".join(line[1:].strip() for line in diff if line.startswith(sign)) for sign in "-+"
        )
        yield Survivor(name, path, old, new)


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.argument("only", nargs=-1)
@click.option("--no-run", is_flag=True, help="Show what the last run has found.")
def main(only: tuple[str, ...], no_run: bool) -> None:
    """Change the code in every way mutmut knows, and count what the unit tests notice.

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
    unused = list(known)
    left: dict[str, list[Survivor]] = defaultdict(list)
    total: Counter[str] = Counter()
    click.echo(f"{'':40}mutants  noticed  the same  left")
    for path, codes in _results().items():
        if not codes:
            continue
        names = [name for name, code in codes.items() if code in (_SURVIVED, _NO_TESTS)]
        survivors = list(_survivors(names, path))
        left[path] = [survivor for survivor in survivors if not survivor.is_same(known)]
        tried = sum(code is not None for code in codes.values())
        counts = tried, tried - len(names), len(survivors) - len(left[path]), len(left[path])
        total.update(dict(zip("tnsl", counts, strict=True)))
        real = max(1, tried - counts[2])
        click.echo(
            f"{path:40}{counts[0]:7}  {counts[1]:7}  {counts[2]:8}  {counts[3]:4}  {counts[1] / real:4.0%}"
        )
        unused = [
            same for same in unused
            if not any(survivor.is_same([same]) for survivor in survivors)
        ]  # fmt: skip
    click.echo(f"{'all':40}{total['t']:7}  {total['n']:7}  {total['s']:8}  {total['l']:4}")
    for survivor in (survivor for survivors in left.values() for survivor in survivors):
        click.echo(f"\n{survivor.name}\n- {survivor.old}\n+ {survivor.new}")
    if not only:
        for same in unused:
            click.echo(f"\nIn same.toml, but noticed or gone: {same['file']}: {same['old']}")
    click.echo(f"\n{time.monotonic() - began:.0f} s")


if __name__ == "__main__":
    main()

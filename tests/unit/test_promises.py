"""Numbers of promises (C2.4) and of facts about rclpy (R4) can be looked up; users see none.

`docs/promises.md` and `docs/rclpy.md` list them, with the tests that hold them.
"""

from __future__ import annotations

import ast
import importlib
import inspect
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from types import ModuleType

import click
import pytest

ROOT = Path(__file__).parents[2]
SOURCE = ROOT / "actionkit"
PAGES = ("promises.md", "rclpy.md")
CITING = ("actionkit", "benchmarks", "docs", "stubs", "tests")
"""Directories whose files may cite a number, besides the files at the top."""
FOR_MAINTAINERS = {*PAGES, "architecture.md"}
"""The pages of `docs/` that may cite numbers; the others are for users."""
PUBLIC = (
    "actionkit",
    "actionkit.agents",
    "actionkit.servers",
    "actionkit.testing",
    "actionkit.testing.plugin",
    "actionkit.trees",
)

NUMBER = re.compile(r"\b(?:C\d+\.\d+|R\d+)\b")
RANGE = re.compile(r"\bC(\d+)\.(\d+)(?: to |-)C\1\.(\d+)")
CHAPTER = re.compile(r"\bcontract (C\d+)\b(?!\.\d)|\((C\d+)[,;)]")
VISIBLE = re.compile(rf"{NUMBER.pattern}|{CHAPTER.pattern}")


def cited(text: str) -> set[str]:
    """Return all numbers that a text names, those between the ends of a range too."""
    found = {*NUMBER.findall(text), *(one or other for one, other in CHAPTER.findall(text))}
    for chapter, first, last in RANGE.findall(text):
        found |= {f"C{chapter}.{number}" for number in range(int(first), int(last) + 1)}
    return found


def citing_files() -> Iterator[Path]:
    for directory in CITING:
        for path in sorted((ROOT / directory).rglob("*")):
            if path.suffix in (".py", ".pyi", ".md") and path.name not in PAGES:
                yield path
    yield from [*ROOT.glob("*.md"), ROOT / "pyproject.toml"]


@cache
def listed() -> dict[str, list[str]]:
    """Return what each listed number names as its tests; a chapter's number names none."""
    found: dict[str, list[str]] = {}
    for page in PAGES:
        text = (ROOT / "docs" / page).read_text("utf-8")
        for chapter in re.findall(r"^## (C\d+) ", text, re.M):
            found[chapter] = []
        for row in re.findall(rf"^\| (?:{NUMBER.pattern}) \|.*$", text, re.M):
            number, *_, tests = [cell.strip() for cell in row.strip("|").split("|")]
            assert number not in found, f"{number} is listed twice"
            found[number] = re.findall(r"`([^`]+)`", tests)
    return found


@cache
def functions(path: Path) -> set[str]:
    kinds = (ast.FunctionDef, ast.AsyncFunctionDef)
    return {
        node.name
        for node in ast.walk(ast.parse(path.read_text("utf-8")))
        if isinstance(node, kinds)
    }


# --- what is cited can be looked up ------------------------------------------------------------


def test_every_number_that_is_cited_is_listed() -> None:
    unknown = {
        str(path.relative_to(ROOT)): missing
        for path in citing_files()
        if (missing := cited(path.read_text("utf-8")) - set(listed()))
    }
    assert unknown == {}


def test_every_number_names_tests_that_exist() -> None:
    for number, tests in listed().items():
        assert tests or re.fullmatch(r"C\d+", number), number
        for test in tests:
            file, _, function = test.partition("::")
            path = ROOT / "tests" / file
            assert path.is_file(), f"{number} names {test}: no such file"
            assert function.startswith("test_"), f"{number} names {test}"
            assert function in functions(path), f"{number} names {test}: no such function"


# --- a run without --long holds each of them -----------------------------------------------------


def is_long(path: Path, function: str) -> bool:
    """Whether the marker `long` is on all of a test, or on its file; not on some parameters."""
    for node in ast.parse(path.read_text("utf-8")).body:
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "pytestmark":
            marks = node.value.elts if isinstance(node.value, ast.List) else [node.value]
        elif isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)) and node.name == function:
            marks = node.decorator_list
        else:
            continue
        if "pytest.mark.long" in map(ast.unparse, marks):
            return True
    return False


def test_each_promise_has_a_test_of_the_default_tier_with_a_real_server() -> None:
    """Which every test outside of `tests/unit` is taken to have."""
    without = set()
    for number, tests in listed().items():
        of_servers = [test.split("::") for test in tests if not test.startswith("unit/")]
        if not re.fullmatch(r"C\d+\.\d+", number):
            continue
        if all(is_long(ROOT / "tests" / file, function) for file, function in of_servers):
            without.add(number)
    assert without == set()


# --- users see none ----------------------------------------------------------------------------


def strings(tree: ast.AST) -> Iterator[str]:
    """Yield every text of the code; texts that stand alone are docstrings, and are left out."""
    alone = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in alone:
            yield node.value


def test_no_text_of_the_code_has_a_number() -> None:
    """What errors, logs and the command line say."""
    found = {
        str(path.relative_to(SOURCE)): texts
        for path in SOURCE.rglob("*.py")
        if (texts := [t for t in strings(ast.parse(path.read_text("utf-8"))) if VISIBLE.search(t)])
    }
    assert found == {}


def public_docs(module: ModuleType) -> Iterator[tuple[str, str]]:
    """Yield the docstrings of a public module, of its public names, and of their public members."""
    yield module.__name__, module.__doc__ or ""
    names = getattr(module, "__all__", None) or [n for n in vars(module) if not n.startswith("_")]
    for name in names:
        value = getattr(module, name)  # it may be imported only then
        ours = getattr(value, "__module__", "") or ""
        if not ours.startswith("actionkit"):
            continue
        yield name, inspect.getdoc(value) or ""
        if not inspect.isclass(value):
            continue
        for member, found in inspect.getmembers(value):
            text = getattr(found, "__doc__", None) or ""
            if (member == "__init__" or not member.startswith("_")) and text != value.__doc__:
                yield f"{name}.{member}", text
        # The texts below the members of an enumeration, or below attributes.
        for cls in value.__mro__:
            if cls.__module__.startswith("actionkit"):
                (body,) = ast.parse(inspect.cleandoc("\n" + inspect.getsource(cls))).body
                assert isinstance(body, ast.ClassDef)
                for node in body.body:
                    if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
                        yield cls.__name__, str(node.value.value)


@pytest.mark.parametrize("module", PUBLIC)
def test_no_docstring_of_a_public_name_has_a_number(module: str) -> None:
    found = list(public_docs(importlib.import_module(module)))
    assert len(found) > 3
    assert {name for name, text in found if VISIBLE.search(text)} == set()


def users_pages() -> list[Path]:
    pages = [ROOT / "README.md"]
    for path in sorted((ROOT / "docs").rglob("*")):
        if path.suffix in (".md", ".txt", ".svg") and path.name not in FOR_MAINTAINERS:
            pages.append(path)
    return pages


@pytest.mark.parametrize("page", users_pages(), ids=lambda path: path.name)
def test_no_page_for_users_has_a_number(page: Path) -> None:
    assert VISIBLE.findall(page.read_text("utf-8")) == []


def test_no_help_of_the_command_line_has_a_number() -> None:
    from actionkit.cli._app import app

    context = click.Context(app, info_name="actionkit")
    shown = {"actionkit": app.get_help(context)}
    for name in app.list_commands(context):
        command = app.get_command(context, name)
        assert command is not None
        shown[name] = command.get_help(click.Context(command, parent=context, info_name=name))
    assert len(shown) > 5
    assert [name for name, text in shown.items() if VISIBLE.search(text)] == []

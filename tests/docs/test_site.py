"""The site has everything: each page is run by a test, each public name is in the reference."""

from __future__ import annotations

import html
import importlib
import inspect
import os
import re
import subprocess
import sys
import zlib
from collections.abc import Iterator
from pathlib import Path

import pytest
from _pytest.fixtures import FixtureFunctionDefinition

from actionkit.testing import plugin
from tests.docs.snippets import ROOT, blocks
from tests.docs.test_pages import DOCS, PAGES

RUN_ELSEWHERE = {
    "guides/gui.md": "tests/docs/test_window.py",
    "guides/micro-ros.md": "tests/field/test_micro_ros.py",
    "guides/moveit.md": "tests/field/test_moveit_page.py",
    "guides/nav2.md": "tests/docs/test_nav2.py",
    "guides/web-pages.md": "tests/field/test_rosbridge.py",
    "guides/what-happened.md": "tests/recordings/test_bags.py",
    "logging.md": "tests/test_logging_docs.py",
    "command-line.md": "its commands are those of tests/cli",
    "CHANGELOG.md": "tells of the past",
    "own-actions.md": "tests/interfaces",
    "testing.md": "tests/fake_server/test_fake_server.py",
    "mcp.md": "tests/agents",
    "stopping.md": "tests/cli/test_stop.py",
    "behaviour-trees.md": "tests/trees",
    "mission-asyncio.md": "tests/trees",
    "cost.md": "the benchmarks",
}
FOR_READERS = ("python", "sh", "bash")
"""Languages of blocks that somebody will copy."""


def _pages() -> list[str]:
    return sorted(str(path.relative_to(DOCS)) for path in DOCS.rglob("*.md"))


def test_every_page_with_code_is_run() -> None:
    with_code = {
        page
        for page in _pages()
        if any(block.language in FOR_READERS for block in blocks(DOCS / page))
    }
    assert with_code - PAGES.keys() - RUN_ELSEWHERE.keys() == set()


MODULES = ["actionkit"] + [
    f"actionkit.{name}" for name in ("testing", "servers", "agents", "trees")
]
NOT_FOR_USERS = ("send", "throw", "set_result", "set_exception", "set_running_or_notify_cancel")
"""Members of `GoalFuture` for asyncio and `concurrent.futures` alone."""


def _inventory(site: Path) -> set[str]:
    """Return the names that have an anchor of their own in the reference."""
    packed = (site / "objects.inv").read_bytes().split(b"\n", 4)[4]
    return {line.split()[0] for line in zlib.decompress(packed).decode().splitlines()}


def _members(cls: type, public: set[type]) -> Iterator[str]:
    """Yield the members of a class that the text of a public class does not have."""
    ours = [base for base in cls.__mro__ if base.__module__.startswith("actionkit")]
    told = "\n".join(base.__doc__ or "" for base in ours if base in public)
    for base in ours:
        for name in {*vars(base), *vars(base).get("__annotations__", {})}:
            attribute = re.search(rf"^ +{name}: ", told, re.M)
            if not name.startswith("_") and name not in NOT_FOR_USERS and not attribute:
                yield name


def _public() -> Iterator[str]:
    """Yield the full name of everything that users can rely on."""
    modules = map(importlib.import_module, MODULES)
    values = {f"{m.__name__}.{name}": getattr(m, name) for m in modules for name in m.__all__}
    classes = {value for value in values.values() if inspect.isclass(value)}
    for name, value in values.items():
        yield name
        if value in classes:
            yield from (f"{name}.{member}" for member in _members(value, classes))
    for name, value in vars(plugin).items():
        if isinstance(value, FixtureFunctionDefinition):
            yield f"{plugin.__name__}.{name}"


def _signatures(page: Path) -> list[str]:
    blocks = re.findall(r"doc-signature.*?<pre.*?>(.*?)</pre>", page.read_text(), re.S)
    return [html.unescape(re.sub(r"<[^>]+>", "", block)) for block in blocks]


@pytest.mark.heavy
@pytest.mark.long
def test_the_reference_has_every_public_member_with_a_readable_signature(tmp_path: Path) -> None:
    pytest.importorskip("mkdocstrings_handlers.python")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "-q", "-d", str(tmp_path)]
    subprocess.run(command, cwd=ROOT, check=True, env={**os.environ, "NO_MKDOCS_2_WARNING": "1"})
    assert set(_public()) - _inventory(tmp_path) == set()

    shown = [each for page in tmp_path.glob("reference/*/index.html") for each in _signatures(page)]
    assert any("    node: Any = None,\n" in each for each in shown)
    for signature in shown:
        assert max(map(len, signature.splitlines())) <= 88


def _anchor(heading: str) -> str:
    """Return what GitHub and the site make of a heading."""
    plain = re.sub(r"[^\w\- ]", "", heading.replace("`", "").lower())
    return re.sub(r"[ ]", "-", plain.strip())


def test_the_links_of_the_readme_lead_somewhere() -> None:
    # Those between the pages are checked by `mkdocs build --strict`.
    for page in ("README.md", "CONTRIBUTING.md"):
        for target in re.findall(r"\]\((?!https?:)([^)]+)\)", (ROOT / page).read_text()):
            name, _, anchor = target.partition("#")
            path = ROOT / name
            assert path.exists(), f"{page}: {target}"
            if anchor:
                headings = re.findall(r"^#+ (.*)$", path.read_text(), re.M)
                assert anchor in map(_anchor, headings), f"{page}: {target}"


def test_pages_are_short_enough_to_be_read_through() -> None:
    # The guides: one task each, and a reader in a hurry.
    for path in (DOCS / "guides").glob("*.md"):
        assert len(path.read_text().splitlines()) < 200, path


def test_reasons_are_given_for_what_is_not_run() -> None:
    for page in _pages():
        for block in blocks(DOCS / page):
            if block.mark.startswith("not run"):
                assert len(block.mark.removeprefix("not run: ").split()) >= 2, (page, block.line)


def test_terms_of_the_glossary_are_sorted_and_told_once() -> None:
    terms = re.findall(r"^\| \*\*(.+?)\*\* \|", (DOCS / "glossary.md").read_text(), re.M)
    assert len(terms) > 20
    assert terms == sorted(set(terms))


def test_every_page_is_in_the_navigation() -> None:
    # Read as text: its tags of Python objects need the theme.
    text = (ROOT / "mkdocs.yml").read_text()
    in_nav = set(re.findall(r"^ +- (?:.*: )?(\S+\.md)$", text, re.M))
    assert in_nav == set(_pages())


def test_no_command_installs_actionkit_from_an_index() -> None:
    # There is no release yet. Only the page on installing says what will be true for one.
    texts = [*ROOT.glob("*.md"), *DOCS.rglob("*.md"), *(ROOT / "actionkit").rglob("*.py")]
    wrong = re.compile(r"pip install [^`\n]*(?<![\w/])actionkit\b")
    found = [str(path.relative_to(ROOT)) for path in texts for _ in wrong.findall(path.read_text())]
    assert found == ["docs/installing.md"]


def test_no_page_is_about_us() -> None:
    wrong = re.compile(r"/root/|/tmp/pytest-")
    for path in [*(Path(DOCS).rglob("*.md")), ROOT / "README.md"]:
        assert not wrong.search(path.read_text()), path

"""The site has everything: each page is run by a test, each public name is in the reference."""

from __future__ import annotations

import importlib
import re
from pathlib import Path

import pytest

from tests.docs.snippets import ROOT, blocks
from tests.docs.test_pages import DOCS, PAGES

RUN_ELSEWHERE = {
    "guides/nav2.md": "tests/docs/test_nav2.py",
    "logging.md": "tests/test_logging_docs.py",
    "command-line.md": "its commands are those of tests/cli",
    "CHANGELOG.md": "tells of the past",
    "own-actions.md": "tests/interfaces",
    "testing.md": "tests/fake_server/test_fake_server.py",
    "agents.md": "tests/agents",
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


@pytest.mark.parametrize(
    "module",
    ["actionkit", "actionkit.testing", "actionkit.servers", "actionkit.agents", "actionkit.trees"],
)
def test_every_public_name_is_in_the_reference(module: str) -> None:
    text = "\n".join(path.read_text() for path in (DOCS / "reference").glob("*.md"))
    shown = set(re.findall(r"^::: (\S+)", text, re.M))
    names = {f"{module}.{name}" for name in importlib.import_module(module).__all__}
    assert module in shown or names - shown == set()


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


def test_no_page_is_about_us() -> None:
    wrong = re.compile(r"/root/|/tmp/pytest-")
    for path in [*(Path(DOCS).rglob("*.md")), ROOT / "README.md"]:
        assert not wrong.search(path.read_text()), path

"""Comments, docstrings and pages are in plain English: these words stay away.

Readers write robots in their second language. Texts that a program shows are not looked at here.
"""

from __future__ import annotations

import ast
import io
import re
import tokenize
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
WORDS = {
    r"for want of": "if there is no, without",
    r"of an? (strange|odd) form": "malformed",
    r"parted by": "separated by",
    r"stands? (there|on|in)": "is there, is on, is in",
    r"deaf": "not responding",
    r"hence": "so",
    r"anew(?!:)": "again, a new one, from the start",
    r"whoever|whomever": "any program that, the caller that, somebody",
    r"but for": "except",
    r"of (which|whom)": "a sentence of its own",
    r"whose(?!:)": "with, of, a sentence of its own",
    r"(takes?|taken|took) note": "record, keep",
    r"be about this": "switch to",
    r"(become|becomes|became) of": "happens to, happened to",
    r"(not?|none|never|nothing|\w+n't)\b[^.;:|]* so far": "yet",
    r"dearer": "slower, more expensive",
    r"learnt|learns? of": "know, discover",
    r"whatever|whichever": "if, even if, all that, any, no matter what",
    r"(?<!there\s)(is|are|was|were|be) no (?!longer|more)": "is not a",
    r"in vain": "without success",
    r"wherever": "if, in each place where",
}
"""What not to write, and what to write instead."""
_PATTERNS = {
    re.compile(rf"\b({word})\b".replace(" ", r"\s+"), re.I): instead
    for word, instead in WORDS.items()
}
_WRITTEN_BY_TESTS = re.compile(r"<!-- table: .*?<!-- end of table -->|^```.*?^```", re.S | re.M)


def prose(path: Path) -> Iterator[tuple[int, str]]:
    """Yield each text for readers in a file, with the number of its first line."""
    text = path.read_text("utf-8")
    if path.suffix == ".md":
        yield 1, _WRITTEN_BY_TESTS.sub(lambda found: "\n" * found[0].count("\n"), text)
        return
    for node in ast.walk(ast.parse(text)):
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.Expr) and isinstance(child.value, ast.Constant):
                yield child.lineno, str(child.value.value)
    above = 0
    block: list[str] = []
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.COMMENT:
            if token.start[0] != above + 1:
                yield above - len(block) + 1, "\n".join(block)
                block = []
            block.append(token.string.lstrip("# "))
            above = token.start[0]
    yield above - len(block) + 1, "\n".join(block)


def files() -> Iterator[Path]:
    yield from sorted((ROOT / "actionkit").rglob("*.py"))
    for page in sorted((ROOT / "docs").rglob("*.md")):
        if page.name != "CHANGELOG.md" and "captures" not in page.parts:
            yield page
    yield from (ROOT / "README.md", ROOT / "CONTRIBUTING.md")


@pytest.mark.long
def test_no_archaic_words() -> None:
    found = []
    for path in files():
        for line, text in prose(path):
            for pattern, instead in _PATTERNS.items():
                for match in pattern.finditer(text):
                    number = line + text.count("\n", 0, match.start())
                    place = f"{path.relative_to(ROOT)}:{number}"
                    found.append(f"{place}: {match[0]!r}; write {instead}")
    assert not found, "\n".join(found)

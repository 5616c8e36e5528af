"""The runner of snippets notices wrong claims."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.docs.snippets import blocks, run_page


def _page(folder: Path, text: str) -> Path:
    page = folder / "page.md"
    page.write_text(text)
    return page


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("```python\nprint(1)  # -> 2\n```\n", "page.md:2 printed '1'"),
        ("```python\nx = 1  # -> 1\n```\n", "nothing was printed"),
        ("```python\nraise KeyError('no')\n```\n", "KeyError"),
        ("```sh\nexit 3\n```\n", "page.md:2"),
        ("<!-- exit code: 3 -->\n```sh\ntrue\n```\n", "page.md:3"),
        ("<!-- prints: b -->\n```sh\necho a\n```\n", "page.md:3"),
    ],
)
def test_what_is_not_so_fails(tmp_path: Path, text: str, told: str) -> None:
    with pytest.raises(AssertionError, match=told):
        run_page(_page(tmp_path, text), tmp_path)


def test_what_is_so_passes(tmp_path: Path) -> None:
    text = """\
<!-- file: one.py -->
```python
ONE = 1
```

```sh
test -f one.py
```

- in a list:

    ```python
    from one import ONE
    print(ONE)  # -> 1
    ```

<!-- not run: an example -->
```python
absent()
```

```python
print("a", ONE, "b")  # ... 1 ...
```

<!-- another program -->
```python
assert "ONE" not in globals()
```
"""
    run_page(_page(tmp_path, text), tmp_path)


def test_blocks_know_their_place(tmp_path: Path) -> None:
    (block,) = blocks(_page(tmp_path, "# A\n\n```sh\nls\n```\n"))
    assert (block.language, block.line, block.text, block.mark) == ("sh", 4, "ls\n", "")

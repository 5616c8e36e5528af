"""The command line's errors name options, not Python arguments."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from actionkit._calls.errors import error_texts, graph_snapshot, still_running
from actionkit._calls.retries import retry, retry_runner
from actionkit._calls.retries.budget import RetryBudget
from actionkit._calls.sending import machine
from actionkit._goal import cancelling
from actionkit._goal import machine as goal_machine
from actionkit._threads.function_runner import LONGEST_ANSWER
from actionkit.cli._shared.wording import _WORDS, in_options
from tests.cli.conftest import FIBONACCI, World

PYTHON = re.compile(r"\b[a-z_]+=|\w\(|`[\w.]+=?`|\b(None|Verdict|Timeouts|RetryPolicy)\b")
"""A keyword, a call, a name of the API."""


def texts_of(path: str) -> Iterator[str]:
    """Yield the texts in a module, f-strings with ? for what is filled in; no docstrings."""
    tree = ast.parse(Path(path).read_text("utf-8"))
    skipped = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            skipped.update(map(id, node.values))
            yield "".join(filled_in(part) for part in node.values)
        elif (
            isinstance(node, ast.Constant)
            and isinstance(node.value, str)
            and id(node) not in skipped
        ):
            yield node.value


def filled_in(part: ast.expr) -> str:
    if isinstance(part, ast.Constant):
        return str(part.value)
    return f"{LONGEST_ANSWER:g}" if "LONGEST_ANSWER" in ast.dump(part) else "?"


def test_no_python_is_left_in_the_texts_of_errors() -> None:
    modules = (
        error_texts,
        still_running,
        graph_snapshot,
        machine,
        retry,
        retry_runner,
        cancelling,
        goal_machine,
    )
    texts = [text for module in modules for text in texts_of(module.__file__)]
    assert len(texts) > 100
    left = {text for text in texts if PYTHON.search(in_options(text))}
    replaces, has_key = "It was to replace an earlier goal", "which an earlier call with key"
    left = {text for text in left if replaces not in text and has_key not in text}
    # These, and a strategy of a user, the command line never has; and a part of a replaced text.
    hint = "; resend='server_gone' tries again when its server has left the graph"
    assert left == {"`RetryPolicy.?=?`", hint}


def test_what_an_error_quotes_is_no_python_either() -> None:
    budget = f"It was not tried again: the retry budget forbids it ({RetryBudget()!r}). Goal 1."
    assert in_options(budget) == "It was not tried again: too many attempts failed. Goal 1."
    hint = "resend='server_gone' tries again when its server has left the graph"
    assert in_options(f"have run (resend='confirmed_stopped'; {hint}).") == "have run."


@pytest.mark.parametrize("python", _WORDS)
def test_what_is_replaced_is_there(python: str) -> None:
    texts = [*texts_of(error_texts.__file__), *texts_of(still_running.__file__)]
    assert any(python in text for text in texts)


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("nobody", "--server-timeout", "0.2"), "with --timeout and --server-timeout."),
        (("nobody", "--timeout", "0"), "and --timeout 0 leaves no time"),
        (("silent", "--accept-timeout", "0.2", "--cancel-timeout", "0.2"), "with --accept-timeout"),
        (("aborts", "--json"), "Look at the result, and at the server's log."),
        (("fibonacci", "--ok", "sequence[0]=7"), "by --ok and --transient its result is a failure"),
        (
            ("fibonacci", "--ok", "sequence[9]=7"),
            "--ok or --transient does not fit the result: sequence: there is no element 9 in an"
            " array of 3. So the call does not count as a success. Name a field that every",
        ),
        (("fibonacci", "--ok", "sequence=7"), "Error: --ok or --transient: that is a sequence<"),
        (
            ("~/fibonacci",),
            "the name '~/fibonacci' is a name below a node, and there is none",
        ),
        (("no name",), "the name 'no name' is not a valid ROS name"),
    ],
)
def test_an_error_names_options(words: tuple[str, ...], told: str, world: World) -> None:
    name, *options = words
    if name in ("silent", "aborts", "fibonacci"):
        world.server(name, **({"period": 0.05} if name == "fibonacci" else {}))
    done = world.run("call", name, FIBONACCI, "{order: 2}", *options)
    text = done.out + done.err
    assert told in text
    assert not PYTHON.search(text[text.rindex("rror") :]), text

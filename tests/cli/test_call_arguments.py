"""`actionkit call` without TYPE, and with NAME and TYPE swapped."""

from __future__ import annotations

import json
import shlex

import pytest

from actionkit import servers
from actionkit.cli._shared.exits import Exit
from tests.cli.conftest import FIBONACCI, NESTED, World

GOAL = "{order: 3}"


@pytest.mark.long
def test_a_server_in_sight_tells_the_type(world: World) -> None:
    world.server("fibonacci", period=0.05)
    done = world.run("call", "fibonacci", GOAL, "--json", "--timeout", "30")
    assert done.code == Exit.OK, done.err
    lines = [json.loads(line) for line in done.out.splitlines()]
    assert {line["action_type"] for line in lines} == {FIBONACCI}
    assert lines[-1]["result"] == {"sequence": [0, 1, 1, 2]}
    # A goal from a pipe, too; and it is checked by that type.
    assert world.run_apart("call", "/fibonacci", "--stdin", stdin=GOAL).code == Exit.OK
    done = world.run("call", "fibonacci", "{oder: 3}")
    assert done.code == Exit.USAGE
    assert "did you mean 'order'?" in done.err


@pytest.mark.long
def test_a_server_is_waited_for(empty_world: World) -> None:
    looking = (
        "import actionkit._ros.others_goals.survey as s; real = s.Survey.settled\n"
        "def settled(*a, **k): print('looking', flush=True); return real(*a, **k)\n"
        "s.Survey.settled = settled"
    )
    running = empty_world.start("call", "fibonacci", GOAL, before=looking)
    running.until("looking")
    empty_world.server("fibonacci", period=0.05)
    assert running.finish() == Exit.OK, running.text
    assert "sequence: [0, 1, 1, 2]" in running.text


def test_without_a_server_the_type_is_not_known(empty_world: World) -> None:
    for option in ("--server-timeout", "--timeout"):
        done = empty_world.run("call", "fibonacci", GOAL, option, "0.2")
        assert (done.code, done.out) == (Exit.NO_SERVER, "")
        assert "'/fibonacci' has no server in sight" in done.err
        assert "its type is not known, and nothing was sent" in done.err
        limit = f"can take 3 s to be seen. To wait longer, use {option}.\n"
        assert done.err.endswith(limit)


@pytest.mark.long
def test_several_types_are_listed(empty_world: World) -> None:
    empty_world.server("fibonacci", period=0.05)
    other = servers.start("wrong_type", action_name="fibonacci", domain_id=empty_world.domain)
    empty_world.stack.enter_context(other)
    # Which of the two is seen first is up to discovery.
    both = (
        "import actionkit._ros.others_goals.survey as s; real = s.Survey.settled\n"
        "def settled(self, *a, enough, **k):\n"
        "    two = lambda seen: enough(seen) and len(seen['/fibonacci'].types) == 2\n"
        "    return real(self, *a, enough=two, **k)\n"
        "s.Survey.settled = settled"
    )
    done = empty_world.run_apart("call", "fibonacci", GOAL, before=both)
    assert done.code == Exit.USAGE
    assert f"served with several types, {FIBONACCI} and {NESTED}. Say which" in done.err


@pytest.mark.parametrize(
    ("words", "told", "right"),
    [
        ((FIBONACCI, "/fibonacci", GOAL), "are swapped", ("/fibonacci", FIBONACCI, GOAL)),
        ((FIBONACCI, "a/fibonacci", GOAL), "are swapped", ("a/fibonacci", FIBONACCI, GOAL)),
        (("test_msgs/Fibonacci", "f"), "are swapped", ("f", "test_msgs/Fibonacci")),
        (
            ("no_msgs/action/Pick", "f", "--stdin"),
            "swapped",
            ("f", "no_msgs/action/Pick", "--stdin"),
        ),
        ((FIBONACCI, GOAL), "NAME is missing", ("NAME", FIBONACCI, GOAL)),
        (("a/fibonacci",), "GOAL is missing", ("a/fibonacci", "{}")),
        (("f", FIBONACCI, "{order:", "5}"), "GOAL has 2 words", ("f", FIBONACCI, "{order: 5}")),
        (("f", "{order:", "5}"), "it is not in quotes", ("f", "{order: 5}")),
    ],
)
def test_what_is_swapped_or_missing_is_told(
    words: tuple[str, ...], told: str, right: tuple[str, ...], world: World
) -> None:
    done = world.run("call", *words)
    assert done.code == Exit.USAGE
    assert told in done.err
    assert done.err.endswith(f": {shlex.join(['actionkit', 'call', *right])}\n")

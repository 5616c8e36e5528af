"""Ids, types, functions and domains that users give: what is taken, and what errors say."""

from __future__ import annotations

import uuid
from typing import Any

import pytest
from test_msgs.action import Fibonacci
from test_msgs.msg import Empty
from test_msgs.srv import Empty as EmptyService

from actionkit._model.action_type import type_name_of
from actionkit._model.arguments import UNSET, check_function, check_type
from actionkit._model.environment.domain import domain_of_text, environment_domain
from actionkit._model.environment.isolation import REMEDY, check_domain, only_in, reserved
from actionkit._model.goal_ids import goal_id_of

ID = uuid.UUID("12345678-1234-5678-1234-567812345678")


@pytest.mark.parametrize("given", [ID, str(ID), ID.hex, ID.hex.upper()])
def test_an_id_may_be_text(given: object) -> None:
    assert goal_id_of(given) == ID


@pytest.mark.parametrize(
    ("given", "error", "told"),
    [
        (
            "abc",
            ValueError,
            "'abc' is not a goal id, which has 32 hexadecimal digits, with dashes or without",
        ),
        (7, TypeError, "7 must be the id of a goal: a uuid.UUID, or text"),
        (
            "0" * 32,
            ValueError,
            f"{uuid.UUID(int=0)} cannot be the id of a goal: servers take it for all goals",
        ),
        (
            uuid.UUID(int=0),
            ValueError,
            f"{uuid.UUID(int=0)} cannot be the id of a goal: servers take it for all goals",
        ),
    ],
)
def test_what_is_not_an_id(given: object, error: type[Exception], told: str) -> None:
    with pytest.raises(error) as caught:
        goal_id_of(given)
    assert (type(caught.value), str(caught.value)) == (error, told)


@pytest.mark.parametrize(
    "given", [Empty, EmptyService, Fibonacci.Goal, Fibonacci.Goal(), "Fibonacci"]
)
def test_what_is_not_an_action_class(given: object) -> None:
    assert type_name_of(Fibonacci) == "test_msgs/action/Fibonacci"
    with pytest.raises(TypeError) as caught:
        type_name_of(given)
    assert str(caught.value) == (
        f"action_type={given!r} must be an action class, such as test_msgs.action.Fibonacci;"
        " not a message, a service, or its Goal"
    )


@pytest.mark.parametrize("lacking", ["Goal", "Result", "Feedback", "Impl"])
def test_an_action_class_has_all_its_parts(lacking: str) -> None:
    parts = {"Goal": 1, "Result": 2, "Feedback": 3, "Impl": 4, "__module__": "a_msgs.action._a"}
    assert type_name_of(type("Whole", (), parts)) == "a_msgs/action/Whole"
    del parts[lacking]
    with pytest.raises(TypeError, match="must be an action class"):
        type_name_of(type("Broken", (), parts))


class Judge:
    def __call__(self, _: object) -> None: ...


class AsyncJudge:
    async def __call__(self, _: object) -> None: ...


async def judge(_: object) -> None: ...


@pytest.mark.parametrize(
    ("given", "told"),
    [
        (3, ""),
        (Judge, "; this is a class: make an instance of it"),
        (
            judge,
            "; this is a coroutine function, and no event loop is there to run it: make it a plain"
            " one",
        ),
        (
            AsyncJudge(),
            "; this is a coroutine function, and no event loop is there to run it: make it a plain"
            " one",
        ),
    ],
)
def test_what_is_not_a_plain_function(given: object, told: str) -> None:
    check_function("judge", Judge(), "a function")
    check_function("judge", lambda _: None, "a function")
    with pytest.raises(TypeError) as caught:
        check_function("judge", given, "a function")
    assert str(caught.value) == f"judge={given!r} must be a function{told}"


def test_a_value_of_the_wrong_class() -> None:
    check_type("answer", 3, int)
    with pytest.raises(TypeError) as caught:
        check_type("answer", "3", int)
    assert str(caught.value) == "answer='3' must be a int"
    assert repr(UNSET) == "<as the client's timeouts.total>"


def test_a_domain_is_read_as_rcl_reads_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """`test_domain.py` asks rcl itself."""
    read: dict[str, int] = {"": 0, "7": 7, "010": 8, "0x8": 8, "+8": 8, " 8": 8, "8a": 8}
    read |= {"0": 0, "232": 232, str(2**64 - 1): 0, "-1": 0}
    assert {text: domain_of_text(text) for text in read} == read
    for text in ("a8", "x", "233", "-2", "1" + 30 * "0", "é", "\udcff"):
        with pytest.raises(ValueError, match=r"^ROS_DOMAIN_ID=") as caught:
            domain_of_text(text)
        assert str(caught.value) == (
            f"ROS_DOMAIN_ID={text!r} in the environment is not a ROS domain: set it to a whole"
            " number from 0 to 232, best up to 101"
        )
    monkeypatch.delenv("ROS_DOMAIN_ID", raising=False)
    assert environment_domain() == 0
    monkeypatch.setenv("ROS_DOMAIN_ID", "12")
    assert environment_domain() == 12


def test_a_domain_that_a_test_has_reserved_keeps_all_others_out() -> None:
    before = reserved()
    check_domain(7)  # nothing is reserved
    with only_in(42):
        assert reserved() == {42}
        check_domain(42)
        with only_in(42), only_in(9):
            check_domain(9)
            with pytest.raises(RuntimeError) as caught:
                check_domain(7)
            assert str(caught.value) == (
                "a test of this process has ROS domain 9 and 42 for itself (`ros_domain`,"
                " `fake_server`, `action_server` or `isolated_domain()`), but this would go to"
                f" domain 7, where a real robot may be. {REMEDY}"
            )
        assert reserved() == {42}
        with pytest.raises(RuntimeError, match="has ROS domain 42 for itself"):
            check_domain(9)
    broken: Any = only_in(5)
    with pytest.raises(ZeroDivisionError), broken:
        1 / 0  # noqa: B018
    assert reserved() == before == frozenset()

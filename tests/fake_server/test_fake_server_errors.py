"""What the functions of a user raise shows in the test."""

from __future__ import annotations

import threading
import time
import uuid
from collections.abc import Iterator
from typing import Any

import pytest
from test_msgs.action import Fibonacci

from actionkit import (
    GoalAbortedError,
    GoalRejectedError,
)
from actionkit.testing import FakeServer
from tests.fake_server.conftest import FIELDS, NOT_RETRIED
from tests.rclpy_client import OK, Driver


class Oops(Exception):
    pass


def oops(_goal: Any) -> Any:
    raise Oops("here")


def some_then_oops(_goal: Any) -> Iterator[Any]:
    yield {"sequence": [1]}
    raise Oops("here")


def fails(_goal: Any) -> Any:
    pytest.fail("this goal should not have come")


REJECTED = [{"accept": oops}, {"end": oops}, {"period": oops}]
RAISING = [
    *[(settings, GoalRejectedError, Oops, "here") for settings in REJECTED],
    ({"script": oops}, GoalRejectedError, Oops, "here"),
    ({"script": [oops]}, GoalRejectedError, Oops, "here"),
    ({"feedback": oops}, GoalAbortedError, Oops, "here"),
    ({"result": oops}, GoalAbortedError, Oops, "here"),
    ({"accept": fails}, GoalRejectedError, pytest.fail.Exception, "should not have come"),
    ({"accept": lambda goal: 1}, GoalRejectedError, TypeError, "accept=1 must be True or False"),
    ({"end": lambda goal: "done"}, GoalRejectedError, ValueError, "end='done' must be 'succ"),
    (
        {"feedback": lambda goal: [{"sequence": [1]}, {"sequenc": 2}]},
        GoalAbortedError,
        ValueError,
        r"feedback\[1\].sequenc: .*did you mean 'sequence'",
    ),
    (
        {"result": lambda goal: {"sequence": [2**31]}},
        GoalAbortedError,
        ValueError,
        r"result.sequence\[0\]: 2147483648 is out of range",
    ),
    (
        {"script": [lambda goal: {"ned": 1}]},
        GoalRejectedError,
        ValueError,
        r"script\[0\]: there is no setting 'ned'; did you mean 'end'\?",
    ),
    ({"feedback": some_then_oops}, GoalAbortedError, Oops, "here"),
]


@pytest.mark.parametrize(("settings", "outcome", "error", "text"), RAISING)
def test_what_a_function_raises_shows_in_the_test(
    ros_domain: int, make_client: Any, settings: Any, outcome: Any, error: Any, text: str
) -> None:
    settings = dict(settings)
    script = settings.pop("script", [])
    server: Any = FakeServer(Fibonacci, "fibonacci", **settings)
    server.script(script)
    with pytest.raises(error, match=text), server:  # noqa: PT012
        client = make_client(retry=NOT_RETRIED)
        with pytest.raises(outcome):
            client.call({"order": 1}, timeout=30.0)
    server.stop()  # once is enough


def test_wait_for_raises_it_at_once_and_it_is_raised_once(
    ros_domain: int, make_client: Any
) -> None:
    with FakeServer(Fibonacci, "fibonacci", accept=oops) as server:
        future = make_client(retry=NOT_RETRIED).call_async({"order": 1}, timeout=60.0)
        began = time.monotonic()
        with pytest.raises(Oops):
            server.wait_for("succeeded", timeout=120)
        assert time.monotonic() - began < 60
        with pytest.raises(GoalRejectedError):
            future.result(30)
        server.wait_for("rejected")
        with pytest.raises(AssertionError, match="saw 0 of 1 'succeeded' events within 0 s"):
            server.wait_for("succeeded", timeout=0)


def test_a_cancel_is_refused_where_the_function_raises(ros_domain: int, driver: Driver) -> None:
    with (  # noqa: PT012
        pytest.raises(Oops),
        FakeServer(Fibonacci, "fibonacci", end="never", cancel=oops) as server,
    ):
        driver.connect()
        goal_id, _ = driver.accepted()
        server.wait_for("executing")
        answer = driver.cancel(goal_id)
    assert answer == (OK, [])


def test_the_error_comes_with_that_of_the_test(ros_domain: int, make_client: Any) -> None:
    with pytest.raises(Oops) as raised, FakeServer(Fibonacci, "fibonacci", result=oops):
        make_client(retry=NOT_RETRIED).call({"order": 1}, timeout=30.0)
    assert isinstance(raised.value.__context__, GoalAbortedError)
    with (  # noqa: PT012
        pytest.raises(KeyboardInterrupt),
        FakeServer(Fibonacci, "fibonacci", result=oops),
    ):
        with pytest.raises(GoalAbortedError):
            make_client(retry=NOT_RETRIED).call({"order": 1}, timeout=30.0)
        raise KeyboardInterrupt


@pytest.mark.long
def test_a_function_that_does_not_return(ros_domain: int, make_client: Any) -> None:
    ends = threading.Event()
    server = FakeServer(Fibonacci, "fibonacci", result=lambda goal: ends.wait(60) and None)
    server.start()
    make_client().call_async({}, timeout=60.0)
    server.wait_for("executing")
    began = time.monotonic()
    with pytest.raises(RuntimeError, match="of 'fibonacci' had not returned 3 s after"):
        server.stop()
    assert time.monotonic() - began < 20
    ends.set()


@pytest.mark.long
def test_functions_that_wait_and_stop(ros_domain: int, make_client: Any) -> None:
    """A function may use its server: neither way does the test hang."""
    waits, stops = (FakeServer(Fibonacci, name) for name in ("waits", "stops"))
    waits.script([{"result": lambda goal: waits.wait_for("aborted", timeout=120) and None}])
    stops.script([{"accept": lambda goal: stops.stop() or True}])
    began = time.monotonic()
    for server in (waits, stops):
        server.start()
    make_client(name="stops").call_async({}, timeout=60.0)
    make_client(name="waits").call_async({}, timeout=60.0)
    waits.wait_for("executing")
    with pytest.raises(AssertionError, match="before the fake server ended"):
        waits.stop()
    with pytest.raises(AssertionError, match="saw 0 of 1 'accepted' events before the fake"):
        stops.wait_for("accepted")
    stops.stop()
    assert time.monotonic() - began < 60


def test_a_request_that_is_sent_again(ros_domain: int, driver: Driver) -> None:
    with FakeServer(Fibonacci, "fibonacci", result=FIELDS) as server:
        server.script([{}, {"accept": False}])
        driver.connect()
        goal_id, future = driver.send()
        assert driver.wait(future).accepted
        server.wait_for("succeeded")
        again, future = driver.send(goal_id=uuid.UUID(goal_id))
        assert not driver.wait(future).accepted
        assert again == goal_id
        assert len(server.goals) == server.count("received") == 1
        driver.rejected()  # the script's second entry is still there

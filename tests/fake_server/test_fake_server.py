"""Fake servers: real ones of any action type, in the test's own process (C9.1)."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from typing import Any

import pytest
from test_msgs.action import Fibonacci, NestedMessage

from actionkit import (
    GoalAbortedError,
    GoalCanceledError,
    GoalRejectedError,
)
from actionkit.testing import EventLog, FakeServer
from tests.fake_server.conftest import ACCEPTED, FIELDS, NOT_RETRIED, names
from tests.rclpy_client import ABORTED, CANCELED, OK, SUCCEEDED, Driver

# --- what it does --------------------------------------------------------------------------------


def test_a_goal_meets_what_was_said(fake_server: Any, make_client: Any) -> None:
    server = fake_server(
        Fibonacci, "fibonacci", feedback=[{"sequence": [7]}, Fibonacci.Feedback()], result=FIELDS
    )
    seen: EventLog[Any] = EventLog()
    result = make_client().call(Fibonacci.Goal(order=5), timeout=30.0, on_feedback=seen)
    assert list(result.sequence) == [3, 1]
    assert [list(one.sequence) for one in seen.wait_for(2)] == [[7], []]
    assert server.goals == [Fibonacci.Goal(order=5)]
    assert names(server) == [*ACCEPTED, "feedback", "feedback", "succeeded"]
    assert server.wait_for("received")[0].details == {"number": 0}
    assert server.running() == set()
    assert server.count("feedback") == 2


def test_nested_fields_and_two_servers(fake_server: Any, make_client: Any) -> None:
    asked = {"nested_field": {"int32_value": 4}}
    fake_server(NestedMessage, "arm/pick", result={"nested_field": {"float64_value": 0.5}})
    other = fake_server(Fibonacci, "fibonacci")
    client = make_client(NestedMessage, "arm/pick")
    assert client.call(asked, timeout=30.0).nested_field.float64_value == 0.5
    assert list(make_client().call({}, timeout=30.0).sequence) == []
    assert other.goals == [Fibonacci.Goal()]


@pytest.mark.parametrize(
    ("settings", "error", "last"),
    [
        ({"accept": False}, GoalRejectedError, "rejected"),
        ({"end": "aborted", "result": FIELDS}, GoalAbortedError, "aborted"),
        ({"end": "canceled", "result": FIELDS}, GoalCanceledError, "canceled"),
        ({"end": "canceled", "result": FIELDS, "cancel": "refuse"}, GoalCanceledError, "canceled"),
    ],
)
def test_ends(
    fake_server: Any, make_client: Any, settings: Any, error: type[Any], last: str
) -> None:
    server = fake_server(Fibonacci, "fibonacci", **settings)
    with pytest.raises(error) as raised:
        make_client().call({"order": 1}, timeout=30.0, retry=NOT_RETRIED)
    if "result" in settings:
        assert list(raised.value.result.sequence) == [3, 1]
    assert names(server)[-1] == last
    assert "cancel_requested" not in names(server)
    assert len(server.goals) == 1


@pytest.mark.parametrize(
    ("settings", "requests", "status", "sequence"),
    [
        ({"end": "never", "result": FIELDS}, "cancel_accepted", CANCELED, [3, 1]),
        ({"end": "canceled", "result": FIELDS}, "cancel_accepted", CANCELED, [3, 1]),
        # The result of a success is not that of a goal which was cancelled.
        ({"result": FIELDS}, "cancel_accepted", CANCELED, []),
        ({"result": FIELDS, "cancel": "ignore"}, "cancel_accepted", SUCCEEDED, [3, 1]),
        ({"end": "aborted", "cancel": "ignore"}, "cancel_accepted", ABORTED, []),
        ({"end": "canceled", "cancel": "ignore"}, "cancel_accepted", CANCELED, []),
        ({"result": FIELDS, "cancel": "refuse"}, "cancel_refused", SUCCEEDED, [3, 1]),
    ],
)  # fmt: skip
def test_cancels_by_a_plain_client(
    fake_server: Any, driver: Driver, settings: Any, requests: str, status: int, sequence: list[int]
) -> None:
    go_on = threading.Event()

    def feedback(_goal: Any) -> Iterator[Any]:
        yield {"sequence": [1]}
        go_on.wait(30)

    server = fake_server(Fibonacci, "fibonacci", feedback=feedback, **settings)
    driver.connect()
    goal_id, handle = driver.accepted()
    server.wait_for("feedback", goal_id=goal_id)
    assert server.running() == {goal_id}
    assert driver.cancel(goal_id) == (OK, [] if requests == "cancel_refused" else [goal_id])
    assert server.wait_for(requests)[0].goal_id == goal_id
    go_on.set()
    assert driver.outcome(handle) == (status, sequence)
    assert names(server, goal_id).count("cancel_requested") == 1


def test_cancel_is_asked_for_each_request_and_may_take_long(
    fake_server: Any, driver: Driver
) -> None:
    answers, stopped = threading.Event(), threading.Event()
    answer = iter(["refuse", "accept"])
    server = fake_server(
        Fibonacci,
        "fibonacci",
        end="never",
        cancel=lambda goal: answers.wait(30) and next(answer),
        result=lambda goal: stopped.wait(30) and FIELDS,
    )
    driver.connect()
    goal_id, handle = driver.accepted()
    server.wait_for("executing")
    refused = handle.cancel_goal_async()
    server.wait_for("cancel_requested")
    driver.accepted()  # other requests are answered meanwhile
    assert not refused.done(), (refused.result(), driver.servers(), server.events)
    answers.set()
    assert driver.wait(refused).goals_canceling == []
    assert driver.cancel(goal_id) == (OK, [goal_id])
    assert goal_id in server.running()  # in CANCELING, until it has stopped
    stopped.set()
    assert driver.outcome(handle) == (CANCELED, FIELDS["sequence"])


@pytest.mark.long
def test_it_ends_while_goals_run_that_never_end(ros_domain: int, driver: Driver) -> None:
    for cancel in ("accept", "ignore"):
        began = time.monotonic()
        with FakeServer(Fibonacci, "fibonacci", end="never", cancel=cancel) as server:  # type: ignore[arg-type]
            driver.connect()
            for _ in range(3):
                goal_id, _ = driver.accepted()
            if cancel == "ignore":
                assert driver.cancel(goal_id) == (OK, [goal_id])
            server.wait_for("executing", count=3)
            assert len(server.running()) == 3
            began = time.monotonic()
        assert time.monotonic() - began < 2.5  # seconds; the wait for threads that don't end: 3


def test_a_script_then_the_settings(fake_server: Any, make_client: Any) -> None:
    server = fake_server(Fibonacci, "fibonacci", result={"sequence": [0]})
    client = make_client(retry=NOT_RETRIED)
    server.script(
        [
            {"accept": False},
            {"end": "aborted"},
            {},
            lambda goal: {"result": {"sequence": [goal.order]}},
            lambda _: None,
        ]
    )
    with pytest.raises(GoalRejectedError):
        client.call({"order": 1}, timeout=30.0)
    with pytest.raises(GoalAbortedError) as aborted:
        client.call({"order": 2}, timeout=30.0)
    assert list(aborted.value.result.sequence) == [0]
    results = [list(client.call({"order": n}, timeout=30.0).sequence) for n in (3, 4, 5, 6)]
    assert results == [[0], [4], [0], [0]]
    assert [goal.order for goal in server.goals] == [1, 2, 3, 4, 5, 6]
    server.script([{"accept": False}] * 5)
    server.script(lambda goal: {"result": {"sequence": [goal.order, goal.order]}})
    for n in (1, 2):
        assert list(client.call({"order": n}, timeout=30.0).sequence) == [n, n]


def test_settings_that_are_functions_of_the_goal(fake_server: Any, make_client: Any) -> None:
    server = fake_server(
        Fibonacci,
        "fibonacci",
        accept=lambda goal: goal.order > 0,
        feedback=lambda goal: [{"sequence": [n]} for n in range(goal.order)],
        period=lambda goal: 0.001 * goal.order,
        end=lambda goal: "aborted" if goal.order > 2 else "succeeded",
        cancel=lambda goal: "refuse",
        result=lambda goal: Fibonacci.Result(sequence=[goal.order]),
    )
    client = make_client(retry=NOT_RETRIED)
    with pytest.raises(GoalRejectedError):
        client.call({"order": 0}, timeout=30.0)
    seen: EventLog[Any] = EventLog()
    result = client.call({"order": 2}, timeout=30.0, on_feedback=seen)
    assert list(result.sequence) == [2]
    assert [list(one.sequence) for one in seen.wait_for(2)] == [[0], [1]]
    with pytest.raises(GoalAbortedError):
        client.call({"order": 3}, timeout=30.0)
    assert server.count("rejected") == 1


def test_requests_are_answered_while_a_function_thinks(fake_server: Any, make_client: Any) -> None:
    goes_on = threading.Event()
    server = fake_server(
        Fibonacci, "fibonacci", accept=lambda goal: goal.order == 1 or goes_on.wait(30)
    )
    client = make_client()
    slow = client.call_async({"order": 0}, timeout=60.0)
    server.wait_for("received")
    client.call({"order": 1}, timeout=30.0)
    assert not slow.done()
    goes_on.set()
    slow.result(30)
    assert server.count("accepted") == 2


@pytest.mark.long
def test_many_goals_at_once(fake_server: Any, make_client: Any) -> None:
    server = fake_server(
        Fibonacci,
        "fibonacci",
        feedback=[{"sequence": [n]} for n in range(3)],
        result=lambda goal: {"sequence": [goal.order]},
    )
    client = make_client()
    futures = [client.call_async({"order": n}, timeout=60.0) for n in range(40)]
    assert [list(future.result(60).sequence) for future in futures] == [[n] for n in range(40)]
    assert [goal.order for goal in server.goals] == list(range(40))
    assert server.wait_for("succeeded", count=40)


# --- waiting -------------------------------------------------------------------------------------


def test_waiting(ros_domain: int) -> None:
    server = FakeServer(Fibonacci, "fibonacci")
    arguments: list[tuple[Any, Any, str]] = [
        (("acepted",), ValueError, "no event 'acepted'. There are: received, accepted"),
        ((None,), ValueError, "no event None"),
    ]
    for given, error, text in arguments:
        with pytest.raises(error, match=text):
            server.wait_for(*given)
        with pytest.raises(error, match=text):
            server.count(*given)
    with pytest.raises(TypeError, match="count='2' must be an int"):
        server.wait_for("accepted", count="2")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="timeout=-1 must be"):
        server.wait_for("accepted", timeout=-1)
    with server:
        waiting = threading.Event()
        raised: list[BaseException] = []

        def wait() -> None:
            waiting.set()
            try:
                server.wait_for("accepted", timeout=120)
            except AssertionError as error:
                raised.append(error)

        thread = threading.Thread(target=wait)
        thread.start()
        waiting.wait()
    thread.join(30)
    assert "'accepted' events before the fake server ended" in str(raised[0])


# --- wrong arguments -----------------------------------------------------------------------------

WRONG: list[tuple[dict[str, Any], type[Exception], str]] = [
    ({"action_type": "test_msgs/action/Fibonacci"}, TypeError, "must be the class itself"),
    ({"action_type": Fibonacci.Goal}, TypeError, "action_type=.* must be an action class"),
    ({"name": 3}, TypeError, "name=3 must be a string"),
    ({"name": "pick it"}, ValueError, "name='pick it' is not a valid ROS name: .*must not contain"),
    ({"name": ""}, ValueError, "name='' is not a valid ROS name"),
    ({"name": "a\0b"}, ValueError, "characters that are no text"),
    ({"accept": 1}, TypeError, "accept=1 must be True or False"),
    ({"preempts": "yes"}, TypeError, "preempts='yes' must be True or False"),
    ({"period": -1}, ValueError, "period=-1 must be zero or more seconds"),
    ({"period": "1"}, TypeError, "period='1' must be a number of seconds"),
    ({"end": "done"}, ValueError, "end='done' must be 'succeeded', 'aborted', 'canceled' or 'nev"),
    ({"cancel": True}, ValueError, "cancel=True must be 'accept', 'refuse' or 'ignore'"),
    ({"result": 3}, TypeError, "result: 3 is of type int"),
    ({"result": Fibonacci.Result}, TypeError, r"result: .*is a class, not a message; call it"),
    ({"result": {"sequence": ["a"]}}, TypeError, r"result.sequence\[0\]: 'a' is of type str"),
    ({"result": Fibonacci.Feedback()}, TypeError, "result: .*Fibonacci_Feedback"),
    ({"feedback": {"sequence": []}}, TypeError, r"for one write \[{'sequence': \[\]}\]"),
    ({"feedback": Fibonacci.Feedback()}, TypeError, r"for one write \["),
    ({"feedback": Fibonacci.Feedback}, TypeError, "feedback=.* must be a list of feedback"),
    ({"feedback": None}, TypeError, r"feedback=None must be a list .*such as \(\)"),
    (
        {"feedback": [{}, {"sequenc": []}]},
        ValueError,
        r"feedback\[1\].sequenc: .*did you mean 'sequence'",
    ),
    ({"feedback": [None]}, TypeError, r"feedback\[0\]: None is no"),
    ({"end": int}, TypeError, "end=<class 'int'> .*this is a class"),
    ({"domain_id": "3"}, TypeError, "domain_id='3' must be an int"),
    ({"domain_id": 300}, ValueError, "domain_id=300 must be 0 to 232"),
]


@pytest.mark.parametrize(("arguments", "error", "text"), WRONG)
def test_wrong_arguments(arguments: dict[str, Any], error: type[Exception], text: str) -> None:
    given: dict[str, Any] = {"action_type": Fibonacci, "name": "fibonacci", **arguments}
    with pytest.raises(error, match=text):
        FakeServer(**given)


def test_coroutine_functions_are_refused() -> None:
    async def result(_goal: Any) -> Any:
        return None

    async def feedback(_goal: Any) -> Any:
        yield {}

    for given in ({"result": result}, {"feedback": feedback}):
        with pytest.raises(TypeError, match=r"coroutine function|async generator"):
            FakeServer(Fibonacci, "fibonacci", **given)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("script", "error", "text"),
    [
        ({"end": "aborted"}, TypeError, "must be a list with an entry for each goal in turn"),
        (3, TypeError, "must be a list with an entry"),
        ([3], TypeError, r"script\[0\]=3 must be a mapping of settings"),
        ([{}, {"end": 3}], ValueError, r"script\[1\].end=3 must be"),
        ([{"ende": 3}], ValueError, r"script\[0\]: there is no setting 'ende'; did you mean 'end'"),
        ([{"result": {"x": 1}}], ValueError, r"script\[0\].result.x: .*is no field"),
        ([{"feedback": [{"x": 1}]}], ValueError, r"script\[0\].feedback\[0\].x: "),
        (Fibonacci, TypeError, "this is a class"),
    ],
)
@pytest.mark.every
def test_wrong_scripts(script: Any, error: type[Exception], text: str) -> None:
    server = FakeServer(Fibonacci, "fibonacci")
    with pytest.raises(error, match=text):
        server.script(script)

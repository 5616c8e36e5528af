"""Fake servers: real ones of any action type, in the test's own process (C9.1)."""

from __future__ import annotations

import os
import threading
import time
import uuid
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from test_msgs.action import Fibonacci, NestedMessage

from actionkit import (
    GoalAbortedError,
    GoalCanceledError,
    GoalRejectedError,
    RetryPolicy,
    ServerLostError,
)
from actionkit.servers._executors import ThreadPerGoalExecutor
from actionkit.servers._harness import Harness
from actionkit.testing import EventLog, FakeServer
from tests.rclpy_client import ABORTED, CANCELED, OK, SUCCEEDED, Driver

ACCEPTED = ["received", "accepted", "executing"]
FIELDS = {"sequence": [3, 1]}
NOT_RETRIED = RetryPolicy.none()


@pytest.fixture
def driver(ros_domain: int) -> Iterator[Driver]:
    driver = Driver(ros_domain)
    yield driver
    driver.close()


def names(server: FakeServer[Any, Any, Any], goal_id: object = None) -> list[str]:
    return [e.event for e in server.events if goal_id is None or e.goal_id == str(goal_id)]


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
        ({"result": FIELDS, "cancel": "refuse"}, "cancel_refused", SUCCEEDED, [3, 1]),
        ({"result": FIELDS, "cancel": "ignore"}, "cancel_accepted", SUCCEEDED, [3, 1]),
        ({"end": "aborted", "cancel": "ignore"}, "cancel_accepted", ABORTED, []),
        ({"end": "canceled", "cancel": "ignore"}, "cancel_accepted", CANCELED, []),
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


# --- errors of the user's functions --------------------------------------------------------------


class Oops(Exception):
    pass


def oops(_goal: Any) -> Any:
    raise Oops("here")


def some_then_oops(_goal: Any) -> Iterator[Any]:
    yield {"sequence": [1]}
    raise Oops("here")


def fails(_goal: Any) -> Any:
    pytest.fail("this goal should not have come")


REJECTED = [{"accept": oops}, {"end": oops}, {"period": oops}, {"cancel": oops}]
RAISING = [
    *[(settings, GoalRejectedError, Oops, "here") for settings in REJECTED],
    ({"script": oops}, GoalRejectedError, Oops, "here"),
    ({"script": [oops]}, GoalRejectedError, Oops, "here"),
    ({"feedback": oops}, GoalAbortedError, Oops, "here"),
    ({"feedback": some_then_oops}, GoalAbortedError, Oops, "here"),
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


# --- its life ------------------------------------------------------------------------------------


def test_a_server_that_comes_back(ros_domain: int, make_client: Any) -> None:
    server = FakeServer(Fibonacci, "fibonacci", end="never")
    assert "stopped" in repr(server)
    server.stop()
    with server:
        assert "running" in repr(server)
        with pytest.raises(RuntimeError, match="was started already"):
            server.start()
        client = make_client(retry=NOT_RETRIED)
        lost = client.call_async({"order": 1}, timeout=60.0)
        server.wait_for("executing")
    assert server.running() == set()
    with pytest.raises(ServerLostError):
        lost.result(60)
    server.script([{"result": FIELDS, "end": "succeeded"}])
    with server:
        assert list(client.call({"order": 2}, timeout=30.0).sequence) == [3, 1]
    assert [goal.order for goal in server.goals] == [1, 2]
    assert [event.incarnation for event in server.events if event.event == "received"] == [0, 1]


def test_fifty_in_a_row_leave_nothing(ros_domain: int, driver: Driver) -> None:
    with FakeServer(NestedMessage, "warm_up"):
        pass
    threads, files = set(threading.enumerate()), len(os.listdir("/proc/self/fd"))
    for number in range(50):
        with FakeServer(Fibonacci, "fibonacci", end="never") as server:
            if number % 10 == 0:
                driver.connect().accepted()
                server.wait_for("executing")
    assert set(threading.enumerate()) <= threads
    # A few are of the client, which keeps something of each server that it met.
    assert len(os.listdir("/proc/self/fd")) <= files + 5


def test_a_stop_or_start_that_is_interrupted_leaves_nothing(
    ros_domain: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ctrl-C while it waits for the functions of the test, or for its thread to begin."""

    class Interrupted(BaseException):
        """As KeyboardInterrupt, which pytest would take for its own."""

    def interrupted(executor: object, seconds: float) -> bool:
        raise Interrupted

    server = FakeServer(Fibonacci, "fibonacci").start()
    harness = server._harness
    assert harness is not None
    with monkeypatch.context() as patch:
        patch.setattr(ThreadPerGoalExecutor, "join_goals", interrupted)
        with pytest.raises(Interrupted):
            server.stop()
    assert not harness._context.ok()
    server.stop()

    # So does a start, whose `with` statement has not begun.
    contexts: list[Any] = []
    start = Harness.start

    def started(harness: Harness) -> None:
        start(harness)
        contexts.append(harness._context)
        raise Interrupted

    with monkeypatch.context() as patch:
        patch.setattr(Harness, "start", started)
        with pytest.raises(Interrupted), server:
            pass
    assert not contexts[0].ok()
    with server:
        assert server.running() == set()


def test_two_on_one_name_and_other_domains(fake_server: Any, make_client: Any) -> None:
    servers = [fake_server(Fibonacci, "fibonacci", result=FIELDS) for _ in range(2)]
    with FakeServer(Fibonacci, "fibonacci", domain_id=0) as elsewhere:
        assert list(make_client().call({}, timeout=30.0).sequence) == [3, 1]
        assert sum(len(server.goals) for server in servers) in (1, 2)
        assert elsewhere.goals == []


EXIT = """
import os, signal, sys
from test_msgs.action import Fibonacci
from actionkit import Client
from actionkit.testing import FakeServer
server = FakeServer(Fibonacci, "fibonacci", end="never").start()
client = Client(Fibonacci, "fibonacci")
future = client.call_async({}, timeout=60)
server.wait_for("executing", timeout=60)
if sys.argv[1] == "rclpy":
    import rclpy
    rclpy.init()
    try:
        signal.raise_signal(signal.SIGINT)   # rclpy's handler shuts down every context
    except KeyboardInterrupt:
        server.stop()
    # Else rclpy's thread for signals now and then aborts the process at its exit.
    rclpy.signals.uninstall_signal_handlers()
elif sys.argv[1] == "fork":
    child = os.fork()
    if child == 0:
        server.stop()
        os._exit(9)  # as multiprocessing does; rclpy itself crashes in a forked child's sys.exit
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 9
    assert server.running()
print("end", flush=True)
"""


@pytest.mark.parametrize("how", ["plain", "rclpy", "fork"])
def test_exit_without_stop(run_script: Callable[..., Any], how: str) -> None:
    script = run_script(EXIT, how)
    code, out, err = script.finish(60)
    assert (code, out.strip(), err) == (0, "end", "")


# --- wrong arguments -----------------------------------------------------------------------------

WRONG: list[tuple[dict[str, Any], type[Exception], str]] = [
    ({"action_type": "test_msgs/action/Fibonacci"}, TypeError, "must be the class itself"),
    ({"action_type": Fibonacci.Goal}, TypeError, "action_type=.* must be an action class"),
    ({"name": 3}, TypeError, "name=3 must be a string"),
    ({"name": "pick it"}, ValueError, "name='pick it' is no valid ROS name: .*must not contain"),
    ({"name": ""}, ValueError, "name='' is no valid ROS name"),
    ({"name": "a\0b"}, ValueError, "characters that are no text"),
    ({"accept": 1}, TypeError, "accept=1 must be True or False"),
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
def test_wrong_scripts(script: Any, error: type[Exception], text: str) -> None:
    server = FakeServer(Fibonacci, "fibonacci")
    with pytest.raises(error, match=text):
        server.script(script)

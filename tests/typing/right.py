"""Code of users, with the types that they must get. For type checkers only: nothing runs it."""

from __future__ import annotations

import asyncio
import concurrent.futures
from array import array
from typing import Any

from test_msgs.action import Fibonacci, NestedMessage
from typing_extensions import assert_type

from actionkit import (
    ActionKitError,
    CallInfo,
    CancelReport,
    Client,
    DeadlineExceededError,
    GoalEvent,
    GoalFuture,
    JsonLines,
    OpenTelemetry,
    Outcome,
    RetryPolicy,
    Rosout,
    Timeline,
    Timeouts,
    Verdict,
    classify_by_field,
    retry_aborted,
)
from actionkit.servers import start
from actionkit.testing import FakeServer
from actionkit.testing.plugin import FakeServerFactory
from actionkit.trees import ActionBehaviour

FibonacciClient = Client[Fibonacci]


def the_action_type_types_the_client() -> None:
    assert_type(Client(Fibonacci, "fibonacci"), FibonacciClient)
    assert_type(Client(NestedMessage, "nested"), Client[NestedMessage])
    annotated: Client[NestedMessage] = Client(NestedMessage, "nested")
    assert_type(annotated.call(NestedMessage.Goal()), NestedMessage.Result)
    Client(
        Fibonacci,
        "fibonacci",
        node=None,
        timeouts=Timeouts(server=1, accept=None, feedback=2.5),
        retry=RetryPolicy(attempts=2, resend="never_accepted"),
        classify=strict,
        observers=(JsonLines("goals.jsonl"), Rosout(None), OpenTelemetry(), Watching()),
        on_close="abandon",
    ).close()


class Watching:
    def on_event(self, event: GoalEvent, call: CallInfo) -> None:
        assert_type(event.attempt, int)


def call() -> None:
    with Client(Fibonacci, "fibonacci") as client:
        assert_type(client, FibonacciClient)
        result = client.call(Fibonacci.Goal(order=10), timeout=10.0)
        assert_type(result, Fibonacci.Result)
        assert_type(result.sequence, "array[int]")
        assert_type(client.call({"order": 10}), Fibonacci.Result)
        assert_type(client.call(Fibonacci.Goal(), 5), Fibonacci.Result)
        assert_type(client.call(Fibonacci.Goal(), None), Fibonacci.Result)
        client.call(Fibonacci.Goal(), retry=RetryPolicy.none(), classify=strict)
        client.call(Fibonacci.Goal(), classify=without_opinion)
        client.call(Fibonacci.Goal(), classify=retry_aborted())
        client.call(Fibonacci.Goal(), classify=classify_by_field("sequence[0]", ok={0}))


def feedback_callbacks() -> None:
    client = Client(Fibonacci, "fibonacci")
    client.call(Fibonacci.Goal(), on_feedback=print)
    client.call(Fibonacci.Goal(), on_feedback=take)
    client.call(Fibonacci.Goal(), on_feedback=lambda feedback: feedback.sequence.append(1))
    client.call_async(Fibonacci.Goal(), take_slowly)
    client.call_async(Fibonacci.Goal(), on_feedback=take_anything, timeout=3)


def call_async() -> None:
    client = Client(Fibonacci, "fibonacci")
    future = client.call_async(Fibonacci.Goal(order=10), on_feedback=print)
    assert_type(future, GoalFuture[Fibonacci.Result, Fibonacci.Feedback])
    assert_type(future.result(), Fibonacci.Result)
    assert_type(future.result(timeout=1.0), Fibonacci.Result)
    assert_type(future.outcome(), Outcome[Fibonacci.Result])
    assert_type(future.outcome().result, Fibonacci.Result | None)
    assert_type(future.outcome().timeline, Timeline)
    for event in future.timeline:
        assert_type(event, GoalEvent)
    assert_type(future.latest_feedback, Fibonacci.Feedback | None)
    for feedback in future.feedback():
        assert_type(feedback, Fibonacci.Feedback)


def as_a_future_of_the_standard_library() -> None:
    client = Client(Fibonacci, "fibonacci")
    future: concurrent.futures.Future[Fibonacci.Result] = client.call_async({"order": 1})
    for done in concurrent.futures.as_completed([future, client.call_async({"order": 2})]):
        assert_type(done.result(), Fibonacci.Result)


async def await_it() -> None:
    async with Client(Fibonacci, "fibonacci") as client:
        assert_type(client, FibonacciClient)
        future = client.call_async(Fibonacci.Goal(order=10))
        async for feedback in future.feedback():
            assert_type(feedback, Fibonacci.Feedback)
        assert_type(await future, Fibonacci.Result)
        both = await asyncio.gather(
            client.call_async({"order": 1}), client.call_async(Fibonacci.Goal())
        )
        assert_type(both, tuple[Fibonacci.Result, Fibonacci.Result])
        task = asyncio.create_task(client.call_async({"order": 1}))
        assert_type(task, asyncio.Task[Fibonacci.Result])
        assert_type(await client.wait_for_server_async(1.0), bool)


def run_it() -> None:
    client = Client(Fibonacci, "fibonacci")
    assert_type(asyncio.run(client.call_async({"order": 1})), Fibonacci.Result)


def a_client_of_any_action(client: Client[Any]) -> object:
    client.call_async({}, on_feedback=take)
    return client.call({"order": 1})


class Counter(Client[Fibonacci]):
    def count(self) -> Fibonacci.Result:
        self.call_async({}, on_feedback=take)
        return self.call(Fibonacci.Goal(order=3))


def a_client_of_ones_own() -> None:
    assert_type(Counter(Fibonacci, "fibonacci").call({}), Fibonacci.Result)
    of_this_action(Counter(Fibonacci, "fibonacci"))
    a_client_of_any_action(Counter(Fibonacci, "fibonacci"))


def failures(client: Client[Fibonacci]) -> None:
    try:
        client.call(Fibonacci.Goal())
    except DeadlineExceededError as error:
        assert_type(error.cancel, CancelReport)
        print(error.cancel.name)
    except ActionKitError as error:
        assert_type(error.cancel, CancelReport | None)


def of_this_action(client: FibonacciClient) -> int:
    a_client_of_any_action(client)
    return client.call(Fibonacci.Goal()).sequence[0]


def take(feedback: Fibonacci.Feedback) -> None:
    assert_type(feedback.sequence, "array[int]")


def take_anything(feedback: object) -> None: ...


async def take_slowly(feedback: Fibonacci.Feedback) -> None: ...


def strict(outcome: Outcome[Fibonacci.Result]) -> Verdict:
    result = outcome.result
    return Verdict.SUCCESS if result is not None and result.sequence else Verdict.PERMANENT


def without_opinion(outcome: Outcome[Fibonacci.Result]) -> Verdict | None:
    return None if outcome.ok else Verdict.TRANSIENT


_ = array


def fake_servers(fake_server: FakeServerFactory) -> None:
    with FakeServer(
        Fibonacci,
        "fibonacci",
        accept=lambda goal: goal.order > 0,
        feedback=[Fibonacci.Feedback(), {"sequence": [1]}],
        period=0.1,
        result=lambda goal: Fibonacci.Result(sequence=[goal.order]),
        end="aborted",
        cancel="refuse",
    ) as server:
        assert_type(server, FakeServer[Fibonacci.Goal, Fibonacci.Result, Fibonacci.Feedback])
        assert_type(server.goals, list[Fibonacci.Goal])
        server.script([{"end": "never"}, lambda goal: {"accept": goal.order > 1}])
        server.script(lambda goal: None)
    assert_type(fake_server(NestedMessage, "pick", result={}).goals, list[NestedMessage.Goal])
    start("silent", action_type=Fibonacci)
    start("silent", action_type="test_msgs/action/Fibonacci", steps=3)


def behaviours(client: Client[Fibonacci]) -> None:
    leaf = ActionBehaviour("count", client, Fibonacci.Goal(order=3))
    assert_type(leaf, ActionBehaviour[Fibonacci.Goal, Fibonacci.Result, Fibonacci.Feedback])
    assert leaf.client is not None
    assert_type(leaf.client.call({}), Fibonacci.Result)
    assert leaf.future is not None
    assert_type(leaf.future.result(), Fibonacci.Result)
    ActionBehaviour("count", (Fibonacci, "fibonacci"), {"order": 3})

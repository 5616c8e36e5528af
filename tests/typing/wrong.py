"""What a type checker must refuse. For type checkers only: nothing runs it.

Each marked line, and no other, is an error to mypy and to pyright, of the kinds in brackets.
"""
# ruff: noqa: B018

from __future__ import annotations

import concurrent.futures

from test_msgs.action import Fibonacci, NestedMessage

from actionkit import Client, GoalFuture, RetryBudget, RetryPolicy, Timeouts
from actionkit.testing import FakeServer
from actionkit.trees import ActionBehaviour

FibonacciClient = Client[Fibonacci]
NestedClient = Client[NestedMessage]


def clients() -> None:
    Client(Fibonacci)  # error[call-arg, reportCallIssue]: no name
    Client("test_msgs/action/Fibonacci", "fibonacci")  # error[arg-type, reportArgumentType]
    Client(Fibonacci.Goal, "fibonacci")  # error[type-var, reportArgumentType]: the goal
    Client(Fibonacci.Impl, "fibonacci")  # error[type-var, reportArgumentType]: no messages in it
    Client(Fibonacci(), "fibonacci")  # error[arg-type, reportArgumentType]: not the class
    Client(Fibonacci, 5)  # error[arg-type, reportArgumentType]: no name
    Client(Fibonacci, "fibonacci", Timeouts())  # error[call-arg, reportCallIssue]: by name
    Client(Fibonacci, "fibonacci", timeouts=5.0)  # error[arg-type, reportArgumentType]
    Client(Fibonacci, "fibonacci", retry=3)  # error[arg-type, reportArgumentType]
    Client(Fibonacci, "fibonacci", on_close="wait")  # error[arg-type, reportArgumentType]
    Client(Fibonacci, "fibonacci", observers=[print])  # error[list-item, reportArgumentType]
    Client(Fibonacci, "fibonacci", timeout=5.0)  # error[call-arg, reportCallIssue]: timeouts


def goals(client: FibonacciClient) -> None:
    client.call(NestedMessage.Goal())  # error[arg-type, reportArgumentType]: another action's
    client.call(Fibonacci.Result())  # error[arg-type, reportArgumentType]
    client.call(Fibonacci.Goal)  # error[arg-type, reportArgumentType]: the class
    client.call(None)  # error[arg-type, reportArgumentType]
    client.call()  # error[call-arg, reportCallIssue]
    client.call_async(NestedMessage.Goal())  # error[arg-type, reportArgumentType]
    client.call({1: 10})  # error[dict-item, arg-type, reportArgumentType]: fields are named
    Fibonacci.Goal(ordr=1)  # error[call-arg, reportCallIssue]
    Fibonacci.Goal(order="1")  # error[arg-type, reportArgumentType]


def options(client: FibonacciClient) -> None:
    goal = Fibonacci.Goal()
    client.call(goal, timeout="5")  # error[arg-type, reportArgumentType]
    client.call(goal, 5.0, print)  # error[misc, call-arg, reportCallIssue]: by keyword only
    client.call(goal, retry=False)  # error[arg-type, reportArgumentType]
    client.call(goal, classify=bool)  # error[arg-type, reportArgumentType]: gives no Verdict
    client.call(goal, deadline=5)  # error[arg-type, call-arg, reportArgumentType, reportCallIssue]
    Timeouts(server="5")  # error[arg-type, reportArgumentType]
    RetryPolicy(resend="sometimes")  # error[arg-type, reportArgumentType]


class Mine(RetryBudget): ...  # error[misc, reportGeneralTypeIssues]: it is final


def feedback(client: FibonacciClient) -> None:
    goal = Fibonacci.Goal()
    client.call(goal, on_feedback=other)  # error[arg-type, reportArgumentType]
    client.call(goal, on_feedback=no_argument)  # error[arg-type, reportArgumentType]
    client.call_async(goal, other)  # error[arg-type, reportArgumentType]
    client.call_async(goal, 10.0)  # error[arg-type, reportArgumentType]: not the timeout
    client.call(
        goal,
        on_feedback=lambda it: it.order,  # error[attr-defined, reportAttributeAccessIssue]
    )


async def results(client: FibonacciClient) -> None:
    goal = Fibonacci.Goal()
    client.call(goal).order  # error[attr-defined, reportAttributeAccessIssue]
    number: int = client.call(goal)  # error[assignment, reportAssignmentType]
    future = client.call_async(goal)
    future.sequence  # error[attr-defined, reportAttributeAccessIssue]: not the result itself
    other_result: NestedMessage.Result = future.result()  # error[assignment, reportAssignmentType]
    other_result = await future  # error[assignment, reportAssignmentType]
    standard: concurrent.futures.Future[int] = future  # error[assignment, reportAssignmentType]
    future.outcome().result.sequence  # error[union-attr, reportOptionalMemberAccess]: may be None
    for each in future.feedback():
        each.order  # error[attr-defined, reportAttributeAccessIssue]
    print(number, other_result, standard)


def other(feedback: NestedMessage.Feedback) -> None: ...


def no_argument() -> None: ...


def of_another_action(client: NestedClient) -> None: ...


of_another_action(Client(Fibonacci, "fibonacci"))  # error[arg-type, reportArgumentType]


def annotated(
    of_the_goal: Client[Fibonacci.Goal],  # error[type-var, reportInvalidTypeArguments]
    of_two: Client[Fibonacci, Fibonacci],  # error[type-arg, reportInvalidTypeArguments]
    future: GoalFuture[Fibonacci],  # error[type-arg, reportInvalidTypeArguments]: of messages
    server: FakeServer[Fibonacci],  # error[type-arg, reportInvalidTypeArguments]
    leaf: ActionBehaviour[Fibonacci],  # error[type-arg, reportInvalidTypeArguments]
) -> None:
    made: NestedClient = Client(Fibonacci, "it")  # error[arg-type, reportAssignmentType]
    print(of_the_goal, of_two, future, server, leaf, made)


def behaviours(client: Client[Fibonacci]) -> None:
    ActionBehaviour("it", client, NestedMessage.Goal())  # error[arg-type, reportArgumentType]
    ActionBehaviour("it", (Fibonacci, "it"), 3)  # error[arg-type, reportArgumentType]


def fake_servers() -> None:
    FakeServer(Fibonacci, "pick", result=3)  # error[arg-type, reportArgumentType]
    FakeServer(Fibonacci, "pick", feedback=[3])  # error[list-item, reportArgumentType]
    FakeServer("test_msgs/action/Fibonacci", "pick")  # error[arg-type, reportArgumentType]
    FakeServer(Fibonacci, "pick", end="done")  # error[arg-type, reportArgumentType]
    FakeServer(Fibonacci, "pick", cancel=True)  # error[arg-type, reportArgumentType]
    FakeServer(Fibonacci, "pick", True)  # error[call-arg, misc, reportCallIssue]

"""Any function of a user may block: calls end, and others go on.

Each call ends within its deadline (and the wait for a cancellation), and a call of another client,
made while the first one hangs in the user's code, is not delayed. What raises or returns nonsense
is tested where it is used: `unit/test_classify.py`, `test_retry.py`, `test_feedback_callbacks.py`,
`test_observers.py` and `test_diagnostics.py`.
"""

from __future__ import annotations

import asyncio
import logging
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from typing import Any

import pytest

import actionkit as ak
from actionkit import RetryPolicy, Timeouts, Verdict

DEADLINE = 2.0
ROOM = 15.0
"""Seconds that a busy machine may add; far less than what blocked functions wait for."""
FOR_EVER = 60.0

Function = Callable[..., Any]


@dataclass
class Misbehaviour:
    """A user's function that blocks or raises."""

    raises: bool = False
    entered: threading.Event = field(default_factory=threading.Event)
    leave: threading.Event = field(default_factory=threading.Event)

    def __call__(self, *args: Any) -> Any:
        self.entered.set()
        if self.raises:
            raise ValueError("from a function of the user's")
        self.leave.wait(FOR_EVER)


@dataclass
class Place:
    """Where a user may hand in a function.

    Attributes:
        script: What the server does.
        options: The client's options, made of the function.
        call: The call's options, made of the function.
        servers: How many servers there are; two are warned of in the log.
        logger: The logger that the function is attached to, and as what, if it is.
        done: Whether it is a done callback.
        coroutine: Whether it is an `on_feedback` that is awaited.
    """

    script: list[Any]
    options: Callable[[Function], dict[str, Any]] = lambda function: {}
    call: Callable[[Function], dict[str, Any]] = lambda function: {}
    logger: tuple[str, str] | None = None
    servers: int = 1
    done: bool = False
    coroutine: bool = False


class Observing:
    """An observer with a function of the test as its hook."""

    def __init__(self, hook: str, function: Function) -> None:
        if hook != "on_event":
            self.on_event = lambda event, call: None
        setattr(self, hook, function)


def observed(hook: str) -> Callable[[Function], dict[str, Any]]:
    return lambda function: {"observers": [Observing(hook, function)]}


def transient(outcome: object) -> Verdict:
    return Verdict.TRANSIENT


def tried_again(**strategies: Function) -> dict[str, Any]:
    return {"retry": RetryPolicy(initial=0.01, **strategies), "classify": transient}  # type: ignore[arg-type]


FEEDBACK: list[Any] = [{"feedback": 3}, "succeed"]
ABORTS: list[Any] = [{"abort": [1]}]
PLACES = {
    "on_feedback": Place(FEEDBACK, call=lambda f: {"on_feedback": f}),
    "on_feedback coroutine": Place(FEEDBACK, coroutine=True),
    "done callback": Place(["succeed"], done=True),
    "classify of a success": Place(["succeed"], lambda f: {"classify": f}),
    "classify of an abort": Place(ABORTS, lambda f: {"classify": f}),
    "stop": Place(ABORTS, lambda f: tried_again(stop=f)),
    "wait": Place(ABORTS, lambda f: tried_again(wait=f)),
    "observer's on_event": Place(["succeed"], observed("on_event")),
    "observer's on_feedback": Place(FEEDBACK, observed("on_feedback")),
    "observer's on_outcome": Place(["succeed"], observed("on_outcome")),
    "handler of actionkit.goal": Place(["succeed"], logger=("actionkit.goal", "handler")),
    "filter of actionkit.goal": Place(["succeed"], logger=("actionkit.goal", "filter")),
    "handler of actionkit": Place(FEEDBACK, logger=("actionkit", "handler")),
    "filter of actionkit": Place(FEEDBACK, logger=("actionkit", "filter")),
    "handler of a warning": Place(["succeed"], logger=("actionkit", "handler"), servers=2),
    "filter of a warning": Place(["succeed"], logger=("actionkit", "filter"), servers=2),
}
CASES = [pytest.param(place, False, id=f"{name} blocks") for name, place in PLACES.items()]
CASES.append(pytest.param(PLACES["done callback"], True, id="done callback raises"))


@contextmanager
def attached(logger_name: str, kind: str, function: Function) -> Iterator[None]:
    """Make a logger call the function for every record, but not for records of its children."""
    logger = logging.getLogger(logger_name)
    level, child = logger.level, logging.getLogger("actionkit.goal")
    child.propagate = False
    handler = logging.NullHandler()
    if kind == "handler":
        handler = logging.Handler()  # type: ignore[assignment]
        handler.emit = function  # type: ignore[method-assign]
    logger.addHandler(handler)
    if kind == "filter":
        logger.addFilter(function)
    logger.setLevel(logging.DEBUG)
    try:
        yield
    finally:
        child.propagate = True
        logger.setLevel(level)
        logger.removeHandler(handler)
        logger.removeFilter(function)


def fail(feedback: object) -> None:
    raise ValueError("for the log")


def outcome_of(client: Any, place: Place, misbehave: Misbehaviour) -> ak.Outcome[Any]:
    """Make a call with the function in its place, and return how it ended."""
    goal, timeout = {"order": 3}, DEADLINE
    if place.coroutine:

        async def on_feedback(feedback: object) -> None:
            misbehave.entered.set()
            await asyncio.Event().wait()

        async def main() -> ak.Outcome[Any]:
            future = client.call_async(goal, on_feedback, timeout)
            await asyncio.wait([asyncio.ensure_future(_awaited(future))], timeout=DEADLINE + ROOM)
            return future.outcome(0)

        return asyncio.run(main())
    options = place.call(misbehave)
    if place.logger is not None and place.logger[0] == "actionkit" and place.servers == 1:
        options["on_feedback"] = fail  # so that something is written there
    future = client.call_async(goal, timeout=timeout, **options)
    if place.done:
        future.add_done_callback(misbehave)
    return future.outcome(DEADLINE + ROOM)


async def _awaited(future: Any) -> Any:
    return await future


@pytest.mark.long
@pytest.mark.parametrize(("place", "raises"), CASES)
def test_the_call_ends_and_others_are_not_delayed(
    place: Place, raises: bool, action_server: Any, make_client: Any
) -> None:
    for _ in range(place.servers):
        action_server("scripted", script=place.script)
    action_server("fibonacci", action_name="other")
    misbehave = Misbehaviour(raises)
    timeouts = Timeouts(cancel=1.0)
    with ExitStack() as stack:
        stack.callback(misbehave.leave.set)
        if place.logger is not None:
            stack.enter_context(attached(*place.logger, misbehave))
        client = make_client(timeouts=timeouts, **place.options(misbehave))
        other = make_client(name="other", timeouts=timeouts)
        assert client.wait_for_server(10)
        assert other.wait_for_server(10)
        ended: list[ak.Outcome[Any]] = []
        thread = threading.Thread(
            target=lambda: ended.append(outcome_of(client, place, misbehave)), daemon=True
        )
        began = time.monotonic()
        thread.start()
        assert misbehave.entered.wait(ROOM)
        # While the function of the first client hangs, if it does.
        assert list(other.call({"order": 2}, ROOM).sequence) == [0, 1, 1]
        thread.join(DEADLINE + ROOM)
        assert ended, "the call never ended"
        assert time.monotonic() - began < DEADLINE + timeouts.cancel + ROOM
        succeeds = place.script[-1] == "succeed" and "classify" not in place.options(misbehave)
        assert ended[0].ok == succeeds, ended[0]
        misbehave.leave.set()


@pytest.mark.long
def test_whatever_is_blocked_the_judge_of_another_client_is_asked(
    action_server: Any, make_client: Any
) -> None:
    """Callbacks, observers and the functions that calls wait for, ten of each, all blocked."""
    action_server("scripted", action_name="blocked", script=[{"feedback": 3}, {"abort": [1]}])
    action_server("aborts")
    leave = threading.Event()

    def block(*args: object) -> Any:
        leave.wait(FOR_EVER)

    def judge(outcome: object) -> Any:
        return leave.wait(FOR_EVER)

    try:
        callbacks = make_client(name="blocked", observers=[Observing("on_event", block)])
        judged = make_client(name="blocked", classify=judge)
        tried = make_client(
            name="blocked", classify=transient, retry=RetryPolicy(stop=block, wait=block)
        )
        for _ in range(10):
            callbacks.call_async({"order": 1}, on_feedback=block).add_done_callback(block)
            judged.call_async({"order": 1})
            tried.call_async({"order": 1})
        client = make_client(classify=transient, retry=RetryPolicy(initial=0.01))
        outcome = client.call_async({"order": 1}, timeout=ROOM).outcome(2 * ROOM)
        assert outcome.attempts == 3
        assert isinstance(outcome.error, ak.GoalAbortedError)
    finally:
        leave.set()

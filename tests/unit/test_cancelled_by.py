"""Whether a goal was cancelled by its own client, or by somebody else. Contract C4.4."""

from __future__ import annotations

import uuid
from types import SimpleNamespace
from typing import Any

import pytest

from actionkit import Timeouts
from actionkit._calls.sending.attempt import Attempt
from actionkit._model.cancel_answer import CancelAnswer
from tests.unit.clock import Clock


@pytest.fixture
def attempt() -> Attempt:
    """Return one with a goal that was cancelled, and then accepted: so the request is repeated."""

    def nothing(*_: Any, **__: Any) -> None: ...

    link: Any = SimpleNamespace(
        runtime=Clock(),
        others_confirmed_at=float("-inf"),
        liveness=SimpleNamespace(start=nothing),
        send_goal=lambda *_: 1,
        sees_server_of=lambda _: True,
        seems_replaced=lambda _: False,
        **dict.fromkeys(("ask_result", "ask_cancel", "stop_cancel", "watch_status"), nothing),
        leave_outbox=nothing,
    )
    owner: Any = SimpleNamespace(
        unwanted=False,
        urgent=False,
        **dict.fromkeys(("on_record", "on_end", "on_over"), nothing),
    )
    one = Attempt(link, uuid.uuid4(), Timeouts(), owner, on_change=nothing)
    one.send(None)
    one.start()
    return one


@pytest.mark.parametrize(
    ("answer", "is_ours"),
    [
        # micro-ROS' server calls a goal ended that it is just accepting.
        (CancelAnswer.ACCEPTED, True),
        # Somebody else was faster.
        (CancelAnswer.TERMINATED, False),
    ],
)
def test_the_answer_to_the_repeated_request_tells_if_the_cancel_was_ours(
    attempt: Attempt, answer: CancelAnswer, is_ours: bool
) -> None:
    """The first request was sent before the goal's acceptance came."""
    sent = attempt._now()
    attempt.on_cancel_sent()
    attempt._link.runtime.advance(0.1)
    attempt.on_accepted()
    attempt.on_cancel_sent()
    attempt.on_cancel_answer(CancelAnswer.TERMINATED, sent)
    assert attempt.cancel_is_ours  # the second may still be the one
    attempt.on_cancel_answer(answer, attempt._now())
    assert attempt.cancel_is_ours is is_ours


@pytest.mark.parametrize("seems_replaced", [False, True])
def test_who_does_not_know_the_goal_is_not_asked_for_the_one_that_only_seems_replaced(
    attempt: Attempt, seems_replaced: bool
) -> None:
    """A server that was stopped for a while takes the request late, and cancels the goal."""
    attempt._link.seems_replaced = lambda _: seems_replaced  # type: ignore[method-assign]
    attempt.on_accepted()
    attempt.on_cancel_sent()
    attempt.on_cancel_answer(CancelAnswer.UNKNOWN_GOAL, attempt._now())
    assert attempt.cancel_is_ours is seems_replaced

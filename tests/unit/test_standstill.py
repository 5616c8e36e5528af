"""A process that was stopped waits before it believes a loss, and finds its servers (C5.4)."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
from clock import Clock

from actionkit._ros.rclpy_private.wait_set import ResponseSource
from actionkit._ros.workarounds.standstill import BELIEVED_AFTER, FOUND_WITHIN, NOTICED, Standstill

LOOK = 2.0


class Thread(Clock):
    """A communication thread with one client, which the test can stop."""

    def __init__(self) -> None:
        super().__init__()
        self.busy = True
        self.slept = 0.0
        self.held_until = 0.0
        self.heard_at = self.answers_at = float("inf")
        self.asked_about_goals = self.replaced = 0
        self.can_leave = True
        self.standstill = Standstill(
            self,
            [self],
            can_leave=lambda: self.can_leave,
            replace_node=self._replace_node,
            clock=lambda: self.now() + self.slept,
        )
        self.standstill.watch()

    def _replace_node(self) -> None:
        self.replaced += 1

    def run(self, seconds: float) -> None:
        for _ in range(round(10 * seconds)):
            self.advance(0.1)
            self.standstill.turn()

    def stand_still(self, seconds: float) -> None:
        self.time += seconds
        self.standstill.turn()

    def is_busy(self) -> bool:
        return self.busy

    def stood_still(self, until: float) -> None:
        self.held_until = until

    def hears(self, since: float) -> bool:
        return self.heard_at > since

    def ask_about_goals(self) -> None:
        self.asked_about_goals += 1


def test_no_loss_is_believed_for_a_while_and_results_are_asked_for() -> None:
    thread = Thread()
    thread.run(10.0)
    assert thread.held_until == 0.0
    thread.stand_still(25.0)
    assert thread.held_until == thread.now() + BELIEVED_AFTER
    thread.run(BELIEVED_AFTER)
    assert thread.asked_about_goals == 1
    assert thread.replaced == 0


def test_where_no_server_answers_the_node_is_replaced_once() -> None:
    thread = Thread()
    thread.heard_at = thread.now()
    thread.stand_still(25.0)
    ended = thread.now()
    thread.run(3.4)
    assert thread.replaced == 0
    thread.run(0.2)
    assert thread.replaced == 1
    assert thread.held_until == pytest.approx(ended + 3.5 + FOUND_WITHIN)
    thread.run(60.0)
    assert thread.replaced == 1
    thread.stand_still(25.0)
    thread.run(4.0)
    assert thread.replaced == 2


def test_an_answer_that_waited_in_a_socket_proves_nothing() -> None:
    thread = Thread()
    thread.stand_still(25.0)
    thread.heard_at = thread.now() + 0.5
    thread.run(4.0)
    assert thread.replaced == 1
    assert thread.asked_about_goals == 0


def test_a_computer_that_slept_is_noticed_although_monotonic_time_stood_still() -> None:
    thread = Thread()
    thread.run(1.0)
    thread.slept = 3600.0
    thread.run(0.1)
    assert thread.held_until == thread.now() + BELIEVED_AFTER


def test_a_second_standstill_starts_the_questions_again() -> None:
    thread = Thread()
    thread.heard_at = thread.now()
    thread.stand_still(25.0)
    thread.run(3.0)
    thread.stand_still(25.0)
    thread.run(3.0)
    assert thread.replaced == 0
    thread.heard_at = thread.now()
    thread.run(4.0)
    assert (thread.replaced, thread.asked_about_goals) == (0, 1)


@pytest.mark.parametrize("seconds", [0.5, NOTICED - LOOK])
def test_a_busy_machine_is_no_standstill(seconds: float) -> None:
    thread = Thread()
    for _ in range(10):
        thread.stand_still(seconds)
        thread.run(0.5)
    assert thread.held_until == 0.0


def test_nobody_looks_at_the_clock_while_nothing_is_in_flight() -> None:
    thread = Thread()
    thread.busy = False
    thread.run(3 * LOOK)
    assert thread.queue.next_due() is None
    thread.stand_still(25.0)
    assert thread.held_until == 0.0


def test_a_standstill_just_after_the_last_goal_is_noticed() -> None:
    thread = Thread()
    thread.run(LOOK - 0.5)
    thread.busy = False  # and so it is at the next look
    thread.run(1.0)
    thread.stand_still(25.0)
    assert thread.held_until > 0.0
    thread.heard_at = 0.0
    thread.run(4.0)
    assert thread.replaced == 1


def test_a_node_that_cannot_be_replaced_just_now_is_replaced_later() -> None:
    thread = Thread()
    thread.can_leave, thread.heard_at = False, 0.0
    thread.stand_still(25.0)
    thread.run(10.0)
    assert thread.replaced == 0
    thread.can_leave = True
    thread.run(1.0)
    assert thread.replaced == 1


def test_the_questions_end_with_the_goals() -> None:
    thread = Thread()
    thread.can_leave, thread.heard_at = False, 0.0
    thread.stand_still(25.0)
    thread.run(10.0)
    thread.busy = False
    thread.run(4 * LOOK)
    assert thread.queue.next_due() is None


class FakeService:
    """A service client, which counts its requests from 1."""

    def __init__(self) -> None:
        self.handle, self.srv_type = self, SimpleNamespace(Response=object)
        self.sent = 0
        self.answers: list[int] = []

    def send_request(self, _: object) -> int:
        self.sent += 1
        return self.sent

    def take_response(self, _: object) -> tuple[Any, Any]:
        if not self.answers:
            return None, None
        number = SimpleNamespace(sequence_number=self.answers.pop(0))
        return SimpleNamespace(request_id=number), "response"


def test_requests_keep_their_numbers_when_their_entity_is_replaced() -> None:
    answered: list[int] = []
    before: Any = FakeService()
    after: Any = FakeService()
    source = ResponseSource(before, lambda number, _: answered.append(number))
    numbers = [source.send(None), source.send(None)]
    source.use(after)
    numbers.append(source.send(None))
    assert numbers == [1, 2, 3]
    after.answers.append(1)
    source.take()
    assert answered == [3]

"""Goal requests are sent in order, with at most one window of unanswered ones (C1.12)."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from actionkit._ros.communication.outbox import WINDOW, Outbox, Window


def key(number: int) -> bytes:
    return number.to_bytes(16, "big")


def nothing() -> None: ...


def outbox_of(count: int, window: int = WINDOW) -> Outbox[int]:
    outbox: Outbox[int] = Outbox(Window(window), nothing)
    for number in range(count):
        outbox.put(key(number), number)
    return outbox


def take_all(outbox: Outbox[int]) -> list[int]:
    taken = []
    while (request := outbox.take()) is not None:
        taken.append(request[1])
    return taken


def test_an_empty_outbox() -> None:
    assert outbox_of(0).take() is None
    assert len(outbox_of(0)) == 0


def test_the_window_fits_the_queue_of_a_server() -> None:
    assert WINDOW < 10  # rclpy's queues are 10 deep (R3)
    assert take_all(outbox_of(100)) == list(range(WINDOW))


@pytest.mark.parametrize("window", [1, 3])
def test_each_answer_lets_one_more_go(window: int) -> None:
    outbox = outbox_of(10, window)
    assert take_all(outbox) == list(range(window))
    for number in range(10):
        outbox.discard(key(number))
        assert take_all(outbox) == ([number + window] if number + window < 10 else [])
    assert len(outbox) == 0


def test_answers_come_in_any_order() -> None:
    outbox = outbox_of(5, window=2)
    assert take_all(outbox) == [0, 1]
    outbox.discard(key(1))
    assert take_all(outbox) == [2]
    outbox.discard(key(0))
    outbox.discard(key(2))
    assert take_all(outbox) == [3, 4]


def test_what_is_discarded_before_its_turn_is_never_sent() -> None:
    outbox = outbox_of(3)
    outbox.discard(key(1))
    assert take_all(outbox) == [0, 2]


def test_urgent_requests_and_senders_go_first() -> None:
    outbox = outbox_of(2)
    for number in (5, 6):
        outbox.put(key(number), number, urgent=True)
    outbox.discard(key(5))
    assert take_all(outbox) == [6, 0, 1]
    window, told = Window(1), []  # type: ignore[var-annotated]
    assert window.enter(nothing)
    for urgent in (None, False, True):
        options: dict[str, Any] = {} if urgent is None else {"urgent": urgent}
        assert not window.enter(lambda urgent=urgent: told.append(urgent), **options)
    window.leave()
    assert told == [True, None, False]


def test_discarding_what_is_not_there_changes_nothing() -> None:
    outbox = outbox_of(3, window=1)
    assert take_all(outbox) == [0]
    outbox.discard(key(9))
    assert take_all(outbox) == []
    outbox.discard(key(0))
    outbox.discard(key(0))
    assert take_all(outbox) == [1]
    assert len(outbox) == 2


@given(
    st.integers(1, 5),
    st.lists(st.one_of(st.just("put"), st.just("take"), st.integers(0, 50)), max_size=100),
)
def test_any_order_of_operations(window: int, steps: list[str | int]) -> None:
    outbox: Outbox[int] = Outbox(Window(window), nothing)
    waiting: list[int] = []
    unanswered: set[int] = set()
    count = 0
    for step in steps:
        if step == "put":
            outbox.put(key(count), count)
            waiting.append(count)
            count += 1
        elif step == "take":
            taken = outbox.take()
            if len(unanswered) < window and waiting:
                first = waiting.pop(0)
                assert taken == (key(first), first)
                unanswered.add(first)
            else:
                assert taken is None
        elif isinstance(step, int):
            outbox.discard(key(step))
            unanswered.discard(step)
            waiting = [number for number in waiting if number != step]
        assert len(unanswered) <= window
        assert len(outbox) == len(waiting) + len(unanswered)


class Sender:
    """Sends everything that its outbox allows, as a link does."""

    def __init__(self, window: Window, numbers: range, log: list[int]) -> None:
        self.log = log
        self.outbox: Outbox[int] = Outbox(window, self.flush)
        for number in numbers:
            self.outbox.put(key(number), number)

    def flush(self) -> None:
        while (request := self.outbox.take()) is not None:
            self.log.append(request[1])

    def answered(self, number: int) -> None:
        self.outbox.discard(key(number))
        self.flush()


def test_those_who_share_a_window_take_turns() -> None:
    window, log = Window(2), []  # type: ignore[var-annotated]
    a, b = (Sender(window, range(start, start + 4), log) for start in (0, 10))
    a.flush()
    b.flush()
    assert log == [0, 1]
    for turn in range(8):
        (b if log[turn] >= 10 else a).answered(log[turn])
    assert log == [0, 1, 2, 10, 3, 11, 12, 13]
    assert len(a.outbox) == len(b.outbox) == 0


def test_one_who_goes_gives_his_places_back() -> None:
    window, log = Window(2), []  # type: ignore[var-annotated]
    a, b, c = (Sender(window, range(start, start + 3), log) for start in (0, 10, 20))
    for sender in (a, b, c):
        sender.flush()
    b.outbox.close()  # while it waits
    assert list(window._waiting[1]) == [a.flush, c.flush]
    a.outbox.close()
    assert log == [0, 1, 20, 21]


def test_many_that_are_not_wanted_any_more_are_given_up_without_recursion() -> None:
    window, log = Window(1), []  # type: ignore[var-annotated]

    class Unwanted(Sender):
        def flush(self) -> None:
            while (request := self.outbox.take()) is not None:
                self.log.append(request[1])
                self.outbox.discard(request[0])

    first = Sender(window, range(1), log)
    first.flush()
    one = Unwanted(window, range(1000, 3000), log)
    many = [Unwanted(window, range(s, s + 2), log) for s in range(3000, 5000, 2)]
    for other in (one, *many):
        other.flush()
    first.answered(0)
    assert log == [0, *range(1000, 5000)]

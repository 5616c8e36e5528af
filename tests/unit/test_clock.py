"""Timers are called in the order of their times, and cost nothing after a cancel."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from actionkit._threads.clock import TimerGroup, TimerHandle, TimerQueue
from tests.unit.clock import Clock

ROOM = 64


def run(queue: TimerQueue, now: float) -> None:
    while (callback := queue.pop_due(now)) is not None:
        callback()


def test_an_empty_queue() -> None:
    queue = TimerQueue()
    assert (queue.next_due(), queue.pop_due(1e9), len(queue)) == (None, None, 0)


def test_timers_are_due_in_order_and_not_before() -> None:
    queue, called = TimerQueue(), list[str]()
    queue.arm(2.0, lambda: called.append("second"))
    queue.arm(3.0, lambda: called.append("third"))
    queue.arm(1.0, lambda: called.append("first"))
    assert queue.next_due() == 1.0
    run(queue, 0.999)
    assert called == []
    run(queue, 2.0)
    assert called == ["first", "second"]
    assert (queue.next_due(), len(queue)) == (3.0, 1)


def test_timers_of_the_same_time_are_called_as_they_were_armed() -> None:
    queue, called = TimerQueue(), list[int]()
    for number in range(100):
        queue.arm(1.0, lambda number=number: called.append(number))  # type: ignore[misc]
    run(queue, 1.0)
    assert called == list(range(100))


def test_a_cancelled_timer_is_not_called() -> None:
    queue, called = TimerQueue(), list[str]()
    cancelled = queue.arm(1.0, lambda: called.append("cancelled"))
    queue.arm(2.0, lambda: called.append("kept"))
    queue.cancel(cancelled)
    queue.cancel(cancelled)
    assert (queue.next_due(), len(queue)) == (2.0, 1)
    run(queue, 9.0)
    assert called == ["kept"]


def test_cancelling_a_timer_that_was_called_is_harmless() -> None:
    queue = TimerQueue()
    handle = queue.arm(1.0, lambda: None)
    queue.arm(2.0, lambda: None)
    assert queue.pop_due(1.0) is not None
    queue.cancel(handle)
    assert len(queue) == 1


def test_a_callback_may_cancel_a_timer_that_is_due_after_it() -> None:
    queue, called = TimerQueue(), list[str]()
    handles: list[TimerHandle] = []

    def first() -> None:
        called.append("first")
        queue.cancel(handles[0])

    queue.arm(1.0, first)
    handles.append(queue.arm(1.0, lambda: called.append("cancelled by the first")))
    run(queue, 5.0)
    assert called == ["first"]


def test_a_callback_may_arm_a_timer_that_is_due_at_once() -> None:
    queue, called = TimerQueue(), list[str]()
    queue.arm(1.0, lambda: queue.arm(0.5, lambda: called.append("armed")) and None)
    run(queue, 1.0)
    assert called == ["armed"]


def test_far_deadlines_that_were_cancelled_are_not_kept() -> None:
    queue, largest = TimerQueue(), 0
    standing = [queue.arm(1e6, lambda: None) for _ in range(10)]
    for call in range(100_000):
        queue.cancel(queue.arm(1000.0 + call, lambda: None))  # a call that ended in time
        largest = max(largest, queue.size)
    assert largest <= 2 * len(standing) + ROOM + 1
    assert len(queue) == len(standing)
    assert queue.next_due() == 1e6


def test_a_crowd_that_is_cancelled_at_once_is_not_kept() -> None:
    queue = TimerQueue()
    for handle in [queue.arm(1000.0, lambda: None) for _ in range(10_000)]:
        queue.cancel(handle)
    assert queue.size <= ROOM


times = st.floats(0, 10)
operations = st.one_of(
    st.tuples(st.just("arm"), times),
    st.tuples(st.just("cancel"), st.integers(0, 200)),
    st.tuples(st.just("run"), times),
)


@given(st.lists(operations, max_size=200))
def test_any_order_of_operations(steps: list[tuple[str, float]]) -> None:
    queue, called = TimerQueue(), list[int]()
    handles: list[TimerHandle] = []
    waiting: dict[int, float] = {}
    now = 0.0
    for name, value in steps:
        if name == "arm":
            number = len(handles)
            waiting[number] = value
            handles.append(queue.arm(value, lambda number=number: called.append(number)))  # type: ignore[misc]
        elif name == "cancel" and handles:
            number = int(value) % len(handles)
            waiting.pop(number, None)
            queue.cancel(handles[number])
        elif name == "run":
            now = max(now, value)
            called.clear()
            run(queue, now)
            due = [number for number, at in waiting.items() if at <= now]
            assert called == sorted(due, key=lambda number: (waiting[number], number))
            for number in due:
                del waiting[number]
        assert len(queue) == len(waiting)
        assert queue.next_due() == min(waiting.values(), default=None)


def test_a_group_of_timers_ends_together() -> None:
    clock = Clock()
    other = clock.call_at(110.0, lambda: None)
    group = TimerGroup(clock, clock.queue.cancel)
    told: list[str] = []
    group.call_at(101.0, lambda: told.append("first"))
    group.call_at(102.0, lambda: group.call_at(103.0, lambda: told.append("from within")))
    group.call_at(104.0, lambda: told.append("too late"))
    clock.advance(3.5)
    assert told == ["first", "from within"]
    group.close()
    group.call_at(105.0, lambda: told.append("after the end"))
    assert len(clock.queue) == 1  # except for the other one
    clock.advance(5.0)
    assert told == ["first", "from within"]
    assert other.callback is not None

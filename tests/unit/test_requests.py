"""Which requests are unanswered, and whose they are: over a middleware that only counts."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from test_msgs.action import Fibonacci

from actionkit._ros.requests import Requests

KEY = bytes(range(16))


class Counter:
    """A service client that sends nowhere."""

    def __init__(self) -> None:
        self.sent: list[Any] = []

    def send(self, request: Any) -> int:
        self.sent.append(request)
        return len(self.sent)


class Thread:
    """The communication thread's clock, which the test moves."""

    def __init__(self) -> None:
        self.due: list[Any] = []

    def now(self) -> float:
        return 0.0

    def call_at(self, at: float, callback: Any) -> None:
        self.due.append(callback)

    def enable(self, source: Any) -> None: ...
    def disable(self, source: Any) -> None: ...


def sent_goal() -> tuple[Requests, Any, Thread]:
    thread = Thread()
    names = ("goal", "result", "cancel", "feedback")
    entities = SimpleNamespace(**{name: Counter() for name in names})
    requests = Requests(thread, entities, Fibonacci.Impl)  # type: ignore[arg-type]
    requests.send_goal(KEY, Fibonacci.Goal(order=1))
    return requests, entities, thread


def test_answers_to_questions_asked_before_do_not_count_when_asked_anew() -> None:
    requests, entities, thread = sent_goal()
    requests.ask_result(KEY)
    requests.ask_result(KEY)
    requests.forget_asks(KEY)
    requests.ask_result(KEY)
    assert len(entities.result.sent) == 2  # at once: it is the first of its kind again
    assert requests.answered("result", 1) is None
    assert requests.answered("result", 2) == KEY
    assert requests.answered("goal", 1) == KEY
    assert thread.due  # the repeated question, which is asked at a measured pace


def test_what_is_forgotten_leaves_nothing_behind() -> None:
    requests, _, _ = sent_goal()
    requests.ask_result(KEY)
    requests.ask_cancel(KEY)
    requests.forget(KEY, elsewhere=False)
    assert set(requests.table_sizes().values()) == {0}
    requests.ask_result(KEY)
    requests.ask_cancel(KEY)
    assert set(requests.table_sizes().values()) == {0}

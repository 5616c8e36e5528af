"""Observers get transitions in order, on another thread, and cannot disturb calls (C6.2)."""

from __future__ import annotations

import concurrent.futures
import logging
import subprocess
import sys
import threading
import time
import uuid
from collections.abc import Callable, Iterator
from typing import Any

import pytest

import actionkit as ak
from actionkit import CallInfo, GoalEvent, GoalState, Outcome, Rosout, Timeline
from actionkit._messages.lazy import LazyMessage
from actionkit._observers import delivery
from actionkit._observers.delivery import Delivery, ObserverDispatcher
from actionkit._observers.goal_log import GoalLog
from actionkit._observers.protocol import Observer, check_observers
from actionkit._observers.words import (
    LEVELS,
    level_of,
    level_of_outcome,
    outcome_sentence,
    outcome_word,
)
from actionkit._threads import diagnostics
from actionkit._threads.in_hand import OBSERVERS, Label
from actionkit._threads.pool import Pool
from actionkit.testing import EventLog
from tests.conftest import NEVER
from tests.unit.gate import Gate

LONG = 10.0
GOAL = uuid.UUID(int=7)
CALL = CallInfo(GOAL, "/fibonacci", "test_msgs/action/Fibonacci", "/robot/planner", 100.0, 5e8)


def event(state: GoalState, at: float = 0.5, detail: str = "", attempt: int = 1) -> GoalEvent:
    return GoalEvent(GOAL, attempt, state, 100.0 + at, 5e8 + at, detail)


def outcome(error: BaseException | None = None) -> Outcome[Any]:
    return Outcome(GoalState.SUCCEEDED, None, error, 2, Timeline(), GOAL, None, elapsed=1.5)


class Noting:
    """An observer with every hook."""

    def __init__(self) -> None:
        self.told: list[tuple[Any, ...]] = []

    def on_event(self, event: GoalEvent, call: CallInfo) -> None:
        self.told.append(("event", event, call))

    def on_feedback(self, event: GoalEvent, feedback: Any, call: CallInfo) -> None:
        self.told.append(("feedback", event, feedback, call))

    def on_outcome(self, outcome: Outcome[Any], call: CallInfo) -> None:
        self.told.append(("outcome", outcome, call))


class OnlyEvents:
    def __init__(self) -> None:
        self.told: list[GoalEvent] = []

    def on_event(self, event: GoalEvent, call: CallInfo) -> None:
        self.told.append(event)


@pytest.fixture
def no_threads(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """As at the interpreter's exit from Python 3.12 on: no thread can be started."""

    def refuse(thread: threading.Thread) -> None:
        raise RuntimeError("can't create new thread at interpreter shutdown")

    monkeypatch.setattr(threading.Thread, "start", refuse)
    yield
    OBSERVERS.clear()  # of what is never told any more


class Queue(Delivery):
    """The jobs for one observer, or for the log."""

    def __init__(self, name: str, observer: Observer | None = None) -> None:
        super().__init__(
            observer or Noting(), Label(name, None, ""), Pool(kind=OBSERVERS), "/fibonacci"
        )

    def flush(self, until: float) -> bool:
        return self._pool.dues.finish(until)


def soon() -> float:
    return time.monotonic() + LONG


# --- the queue -------------------------------------------------------------------------------


def test_jobs_run_in_order_and_one_at_a_time_from_any_threads() -> None:
    queue, alone = Queue("it"), threading.Lock()
    notes: list[tuple[int, int]] = []
    overlaps = []

    def job(who: int, number: int) -> None:
        if not alone.acquire(blocking=False):
            overlaps.append(1)
            return
        notes.append((who, number))
        alone.release()

    def putter(who: int) -> Callable[[], None]:
        return lambda: [queue.put_job(lambda n=n: job(who, n)) for n in range(500)] and None

    threads = [threading.Thread(target=putter(who)) for who in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert queue.flush(soon())
    assert overlaps == []
    assert len(notes) == 2000
    for who in range(4):
        assert [number for each, number in notes if each == who] == list(range(500))


def test_flushing_waits_for_no_longer_than_it_is_told() -> None:
    queue, gate = Queue("it"), Gate()
    queue.put_job(gate)
    assert gate.entered.wait(LONG)
    assert not queue.flush(time.monotonic() + 0.05)
    gate.leave.set()
    assert queue.flush(soon())


def test_a_job_that_raises_closes_the_queue_with_one_warning(
    caplog: pytest.LogCaptureFixture,
) -> None:
    queue, notes = Queue("observer X"), list[int]()
    gate = Gate()
    queue.put_job(gate)
    queue.put_job(lambda: 1 / 0)
    queue.put_job(lambda: 1 / 0)
    queue.put_job(lambda: notes.append(1))
    gate.leave.set()
    assert queue.flush(soon())
    queue.put_job(lambda: notes.append(2))
    assert queue.flush(soon())
    assert notes == []
    (record,) = caplog.records
    assert record.levelname == "WARNING"
    assert (
        record.getMessage() == "observer X of action '/fibonacci' raised, and is told nothing more"
    )
    assert record.exc_info is not None
    assert record.exc_info[0] is ZeroDivisionError


def test_where_too_much_waits_feedback_goes_first_and_is_told_of_once(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(delivery, "MOST_FEEDBACK", 3)
    monkeypatch.setattr(delivery, "MOST", 6)
    queue, gate, notes = Queue("observer X"), Gate(), list[str]()
    queue.put_job(gate)
    assert gate.entered.wait(LONG)
    for number in range(5):
        queue.put_job(lambda n=number: notes.append(f"feedback {n}"), feedback=True)
    for number in range(5):
        queue.put_job(lambda n=number: notes.append(f"event {n}"))
    gate.leave.set()
    assert queue.flush(soon())
    assert notes == ["feedback 0", "feedback 1", "feedback 2", "event 0", "event 1", "event 2"]
    (record,) = caplog.records
    assert "observer X of action '/fibonacci' is too slow" in record.getMessage()


@pytest.mark.usefixtures("no_threads")
def test_at_exit_what_no_thread_came_for_is_told_here() -> None:
    queue, notes = Queue("it"), list[int]()
    for number in range(3):
        queue.put_job(lambda n=number: notes.append(n))
    assert not queue.flush(time.monotonic() + 0.02)
    delivery.flush_all(soon())
    assert notes == [0, 1, 2]
    assert OBSERVERS == {}


@pytest.mark.usefixtures("no_threads")
def test_at_exit_many_events_take_no_longer_than_the_time_there_is(
    caplog: pytest.LogCaptureFixture,
) -> None:
    queue, notes = Queue("X"), list[int]()
    for number in range(10):
        queue.put_job(lambda n=number: (notes.append(n), NEVER.wait(0.1)))
    delivery.flush_all(time.monotonic() + 0.25)
    assert notes[:2] == [0, 1]
    assert len(notes) < 6
    diagnostics.flush(soon())
    assert "at exit, X of action '/fibonacci' had not been told everything" in caplog.text


@pytest.mark.usefixtures("no_threads")
def test_at_exit_a_human_need_not_wait_for_an_observer() -> None:
    queue, notes = Queue("it"), list[int]()

    def interrupted() -> None:
        raise KeyboardInterrupt

    queue.put_job(interrupted)
    queue.put_job(lambda: notes.append(1))
    with pytest.raises(KeyboardInterrupt):
        delivery.flush_all(soon())
    assert notes == []


@pytest.mark.usefixtures("no_threads")
def test_at_exit_an_observer_that_hangs_is_cut_off(caplog: pytest.LogCaptureFixture) -> None:
    queue = Queue("X")
    queue.put_job(threading.Event().wait)
    delivery.flush_all(time.monotonic() + 0.1)
    diagnostics.flush(soon())
    assert "at exit, X of action '/fibonacci' had not been told everything" in caplog.text


def test_what_is_not_told_at_exit_is_told_of(
    caplog: pytest.LogCaptureFixture, capsys: pytest.CaptureFixture[str]
) -> None:
    observer, log, gate = Queue("X"), Queue("the log", GoalLog()), Gate()
    for queue in (observer, log):
        queue.put_job(gate)
        assert gate.entered.wait(LONG)
        gate.entered.clear()
    delivery.flush_all(time.monotonic() + 0.02)
    assert diagnostics.flush(soon())
    text = "at exit, {} of action '/fibonacci' had not been told everything"
    assert [r.getMessage() for r in caplog.records] == [text.format("X")]
    # A log that takes nothing is not asked to take this.
    assert capsys.readouterr().err == text.format("the log") + "\n"
    gate.leave.set()
    assert observer.flush(soon())
    assert log.flush(soon())


def test_the_log_goes_on_after_an_error_and_warns_once_a_minute(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    queue, notes = Queue("the log", GoalLog()), list[int]()

    def job(number: int) -> None:
        notes.append(number)
        raise SystemExit("not even this")

    for number in range(5):
        queue.put_job(lambda n=number: job(n))
    assert queue.flush(soon())
    assert notes == [0, 1, 2, 3, 4]
    monkeypatch.setattr(queue, "_quiet_until", 0.0)  # as a minute later
    queue.put_job(lambda: job(5))
    assert queue.flush(soon())
    said = [r.getMessage().partition(", and")[0] for r in caplog.records]
    raised = "the log of action '/fibonacci' raised"
    assert said == [f"{raised} (1 times so far)", f"{raised} (6 times so far)"]


def test_a_warning_that_cannot_be_written_ends_nothing(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """A handler of the root logger gets the warning of its own error, too."""
    handler = logging.Handler()

    def emit(record: logging.LogRecord) -> None:
        raise ValueError("from the handler")

    handler.emit = emit  # type: ignore[method-assign]
    queue, notes = Queue("the log", GoalLog()), list[int]()
    logging.getLogger("actionkit").addHandler(handler)
    try:
        for number in range(3):
            queue.put_job(lambda n=number: notes.append(n) or 1 / 0)
        assert queue.flush(soon())
    finally:
        logging.getLogger("actionkit").removeHandler(handler)
    assert notes == [0, 1, 2]
    assert "ValueError: from the handler" in capsys.readouterr().err


AT_EXIT = """
import atexit, threading
from actionkit._observers import delivery
import time
from actionkit._observers.goal_log import GoalLog
from actionkit._threads.in_hand import OBSERVERS, Label
from actionkit._threads.pool import Pool
queue = delivery.Delivery(GoalLog(), Label("it", None, ""), Pool(kind=OBSERVERS), "/fibonacci")
def at_exit():
    for number in range(3):
        queue.put_job(lambda n=number: print(n, flush=True))
    delivery.flush_all(time.monotonic() + 10)
atexit.register(at_exit)
"""


def test_an_event_of_the_exit_itself_is_told() -> None:
    run = [sys.executable, "-W", "error", "-c", AT_EXIT]
    done = subprocess.run(run, capture_output=True, text=True, timeout=30, check=True)
    assert (done.stdout, done.stderr) == ("0\n1\n2\n", "")


# --- the dispatcher ------------------------------------------------------------------------------


def test_all_are_told_all_in_order() -> None:
    first, second = Noting(), OnlyEvents()
    dispatcher = ObserverDispatcher((first, second), action_name="/fibonacci")
    events = [event(GoalState.SENDING), event(GoalState.FEEDBACK), event(GoalState.SUCCEEDED)]
    decoded: list[object] = []

    def decode() -> str:
        decoded.append(threading.current_thread())
        return "the message"

    for each in events:
        dispatcher.event(each, CALL, decode if each.state is GoalState.FEEDBACK else None)
    end = outcome()
    dispatcher.outcome(end, CALL)
    dispatcher.flush(soon())
    assert first.told == [
        ("event", events[0], CALL),
        ("feedback", events[1], "the message", CALL),
        ("event", events[2], CALL),
        ("outcome", end, CALL),
    ]
    assert second.told == events
    assert len(decoded) == 1  # only for who wants it
    assert decoded != [threading.current_thread()]


def test_feedback_that_cannot_be_decoded_is_an_event_without_its_message(
    caplog: pytest.LogCaptureFixture,
) -> None:
    """It is no fault of the observer's, who must not be dropped for it."""
    first, second = Noting(), OnlyEvents()
    dispatcher = ObserverDispatcher((first, second), action_name="/fibonacci")
    events = [event(GoalState.FEEDBACK), event(GoalState.SUCCEEDED)]

    def decode(_: bytes) -> Any:
        raise RuntimeError("cut off")

    dispatcher.event(events[0], CALL, LazyMessage(decode, b""))
    dispatcher.event(events[1], CALL)
    dispatcher.flush(soon())
    assert first.told == [("event", each, CALL) for each in events]
    assert second.told == events
    assert [record.levelname for record in caplog.records] == ["WARNING"]
    assert "cut off" in caplog.text


def test_one_that_blocks_or_raises_harms_nobody_else(caplog: pytest.LogCaptureFixture) -> None:
    gate, good, raised = Gate(), EventLog[GoalEvent](), EventLog[str]()

    class Blocking:
        def on_event(self, event: GoalEvent, call: CallInfo) -> None:
            gate()

    class Raising:
        def on_event(self, event: GoalEvent, call: CallInfo) -> None:
            raised.append("")
            raise SystemExit("not even this")

    dispatcher = ObserverDispatcher((Blocking(), Raising(), good), action_name="/fibonacci")
    for _ in range(3):
        dispatcher.event(event(GoalState.SENT), CALL)
    assert len(good.wait_for(3)) == 3
    gate.leave.set()
    dispatcher.flush(soon())
    assert len(raised) == 1
    assert len([r for r in caplog.records if "Raising" in r.getMessage()]) == 1


def test_the_callers_context_is_kept_for_those_who_look() -> None:
    begun = {"monotonic": 1.0, "wall": 2.0}
    assert ObserverDispatcher().call_info(GOAL, None, **begun).context is None
    assert ObserverDispatcher((Noting(),)).call_info(GOAL, None, **begun).context is not None


class Asynchronous:
    async def on_event(self, event: GoalEvent, call: CallInfo) -> None: ...


class HalfAnObserver(OnlyEvents):
    on_outcome = "not to be called"


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (Noting(), "must be a list of observers"),
        ("JsonLines", "must be a list of observers"),
        (None, "must be a list of observers"),
        ([Noting], "is a class; make an instance"),
        ([print], "it has no on_event"),
        ([None], "it has no on_event"),
        ([Asynchronous()], "is a coroutine function"),
        ([HalfAnObserver()], "it has no on_outcome"),
    ],
)
def test_what_is_no_observer_is_refused(given: Any, said: str) -> None:
    with pytest.raises(TypeError, match="observers") as caught:
        check_observers(given)
    assert said in str(caught.value)


def test_the_same_observer_twice_is_refused() -> None:
    observer = Noting()
    with pytest.raises(ValueError, match="twice"):
        check_observers([observer, observer])
    assert check_observers(iter([observer, Noting()]))[0] is observer


# --- the log -----------------------------------------------------------------------------------


@pytest.fixture
def records() -> Iterator[list[logging.LogRecord]]:
    """All records of the goals' log."""
    kept: list[logging.LogRecord] = []
    handler = logging.Handler(logging.DEBUG)
    handler.emit = kept.append  # type: ignore[method-assign]
    logger = logging.getLogger("actionkit.goal")
    logger.addHandler(handler)
    logger.setLevel(logging.DEBUG)
    yield kept
    logger.removeHandler(handler)
    logger.setLevel(logging.NOTSET)


FIELDS = {
    *("kind", "call_id", "goal_id", "action_name", "action_type", "node_name", "attempt"),
    *("state", "elapsed_ms", "detail", "cancel_refused", "outcome"),
}


def extra(record: logging.LogRecord) -> dict[str, Any]:
    plain = set(vars(logging.makeLogRecord({}))) | {"message", "asctime", "taskName"}
    return {name: value for name, value in vars(record).items() if name not in plain}


def test_the_fields_of_an_event(records: list[logging.LogRecord]) -> None:
    GoalLog().on_event(event(GoalState.RETRYING, 0.5, "in 0.20 s", attempt=2), CALL)
    (record,) = records
    assert extra(record) == {
        "kind": "event",
        "call_id": str(GOAL),
        "goal_id": str(GOAL),
        "action_name": "/fibonacci",
        "action_type": "test_msgs/action/Fibonacci",
        "node_name": "/robot/planner",
        "attempt": 2,
        "state": "RETRYING",
        "elapsed_ms": 500.0,
        "detail": "in 0.20 s",
        "cancel_refused": False,
        "outcome": "",
    }
    assert record.levelno == logging.WARNING
    assert record.getMessage() == (
        f"[/robot/planner] /fibonacci goal {GOAL} RETRYING after 500.0 ms, attempt 2: in 0.20 s"
    )
    assert record.created == 5e8 + 0.5  # when it was, not when it was told
    assert record.msecs == 500.0


def test_the_fields_of_an_outcome(records: list[logging.LogRecord]) -> None:
    GoalLog().on_outcome(outcome(ak.GoalAbortedError("It was aborted.")), CALL)
    (record,) = records
    assert set(extra(record)) == FIELDS
    assert (record.levelno, extra(record)["outcome"]) == (logging.WARNING, "GoalAbortedError")
    assert record.getMessage().endswith("call failed (GoalAbortedError): It was aborted.")
    assert extra(record)["elapsed_ms"] == 1500.0


def test_every_state_has_a_level() -> None:
    assert set(LEVELS) == set(GoalState)
    assert level_of(event(GoalState.ACCEPTED)) == logging.INFO
    assert level_of(event(GoalState.FEEDBACK, detail="no. 1")) == logging.DEBUG
    assert level_of(event(GoalState.EXECUTING, detail="a remark")) == logging.DEBUG


@pytest.mark.parametrize("state", [GoalState.ACCEPTED, GoalState.EXECUTING, GoalState.CANCELING])
def test_a_refused_cancel_is_a_warning_whatever_the_goals_state(state: GoalState) -> None:
    """Also where another client's cancel was accepted, so that the goal is being cancelled."""
    refusal = GoalEvent(GOAL, 1, state, 100.5, 5e8, "why", cancel_refused=True)
    assert level_of(refusal) == logging.WARNING


@pytest.mark.parametrize(
    ("error", "level", "word"),
    [
        (None, logging.DEBUG, "ok"),
        (concurrent.futures.CancelledError("by its caller"), logging.INFO, "cancelled"),
        (ak.ClientClosedError("closed"), logging.WARNING, "ClientClosedError"),
        (ak.GoalRejectedError("no"), logging.WARNING, "GoalRejectedError"),
        (ak.DeadlineExceededError("late"), logging.WARNING, "DeadlineExceededError"),
    ],
)
def test_the_level_of_an_outcome(error: BaseException | None, level: int, word: str) -> None:
    assert level_of_outcome(outcome(error)) == level
    assert outcome_word(outcome(error)) == word


def test_a_cancelled_call_did_not_fail() -> None:
    cancelled = outcome(concurrent.futures.CancelledError("goal 1 was cancelled by its caller"))
    told = "/fibonacci call cancelled: goal 1 was cancelled by its caller"
    assert outcome_sentence(cancelled, "/fibonacci") == told
    failed = outcome_sentence(outcome(ak.GoalRejectedError("no")), "/fibonacci")
    assert failed == "/fibonacci call failed (GoalRejectedError): no"


def test_nothing_is_made_where_nobody_listens(monkeypatch: pytest.MonkeyPatch) -> None:
    put = []
    monkeypatch.setattr(Delivery, "put_job", lambda *args, **named: put.append(args))
    dispatcher = ObserverDispatcher(action_name="/fibonacci")
    for state in (GoalState.SENDING, GoalState.ACCEPTED, GoalState.FEEDBACK, GoalState.SUCCEEDED):
        dispatcher.event(event(state), CALL)
    dispatcher.outcome(outcome(), CALL)
    assert put == []  # the root logger passes warnings on, and these are not warnings


SILENT = """
import actionkit as ak, uuid, time
from actionkit._observers.delivery import ObserverDispatcher
dispatcher = ObserverDispatcher(action_name="/fibonacci")
id = uuid.uuid4()
call = dispatcher.call_info(id, None, monotonic=0.0, wall=0.0)
dispatcher.event(ak.GoalEvent(id, 1, ak.GoalState.ABORTED, 1.0, 1.0), call)
dispatcher.outcome(ak.Outcome(ak.GoalState.ABORTED, None, ak.GoalAbortedError("no"), 1,
    ak.Timeline(), id, None), call)
dispatcher.flush(time.monotonic() + 10)
"""


def test_the_log_is_silent_by_default() -> None:
    done = subprocess.run(
        [sys.executable, "-c", SILENT], capture_output=True, text=True, timeout=30, check=True
    )
    assert (done.stdout, done.stderr) == ("", "")


# --- rosout ------------------------------------------------------------------------------------


class NodeLogger:
    def __init__(self) -> None:
        self.lines: list[tuple[str, str]] = []

    def __getattr__(self, level: str) -> Callable[[str], None]:
        return lambda text: self.lines.append((level, text))


class FakeNode:
    def __init__(self) -> None:
        self.logger = NodeLogger()

    def get_logger(self) -> NodeLogger:
        return self.logger


def test_rosout_has_the_levels_of_the_log() -> None:
    node = FakeNode()
    rosout = Rosout(node)
    for state in (GoalState.SENT, GoalState.ACCEPTED, GoalState.ABORTED):
        rosout.on_event(event(state), CALL)
    rosout.on_outcome(outcome(ak.GoalAbortedError("It was aborted.")), CALL)
    assert [level for level, _ in node.logger.lines] == ["debug", "info", "warning", "warning"]
    assert node.logger.lines[1][1] == f"/fibonacci goal {GOAL} ACCEPTED after 500.0 ms"


def test_rosout_wants_a_node() -> None:
    for wrong in ("planner", None, FakeNode):
        with pytest.raises(TypeError, match="must be an rclpy node"):
            Rosout(wrong)


@pytest.mark.parametrize("name", ["tracer_provider", "meter_provider"])
def test_opentelemetry_wants_providers(name: str) -> None:
    wrong: dict[str, Any] = {name: "otlp"}
    with pytest.raises(TypeError, match=rf"^OpenTelemetry: {name}='otlp' must have get_"):
        ak.OpenTelemetry(**wrong)

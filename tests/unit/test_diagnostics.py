"""What a thread logs that must not run log handlers: on another thread, whatever they do."""

from __future__ import annotations

import logging
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager

import pytest

from actionkit._threads import diagnostics
from actionkit.testing import EventLog
from tests.conftest import NEVER

LONG = 10.0
LOGGER = logging.getLogger("actionkit")


def soon() -> float:
    return time.monotonic() + LONG


@contextmanager
def handled_by(emit: Callable[[logging.LogRecord], object]) -> Iterator[None]:
    handler = logging.Handler()
    handler.emit = emit  # type: ignore[assignment]
    LOGGER.addHandler(handler)
    try:
        yield
    finally:
        LOGGER.removeHandler(handler)


class Stuck:
    """A handler that blocks."""

    def __init__(self) -> None:
        self.entered, self.leave = threading.Event(), threading.Event()
        self.records: list[logging.LogRecord] = []

    def __call__(self, record: logging.LogRecord) -> None:
        self.records.append(record)
        self.entered.set()
        assert self.leave.wait(LONG)


def test_a_record_tells_who_logged_it_where_and_when() -> None:
    records, stuck = EventLog[logging.LogRecord](), Stuck()
    with handled_by(stuck), handled_by(records.append):
        diagnostics.log_later(logging.WARNING, "first")
        assert stuck.entered.wait(LONG)
        before = time.time()
        try:
            raise ValueError("the cause")
        except ValueError:
            diagnostics.log_later(logging.ERROR, "%s of %d", "one", 2, exc_info=True, stack="here")
        after = time.time()
        NEVER.wait(0.1)
        stuck.leave.set()
        assert diagnostics.flush(soon())
    first, record = records
    assert (first.getMessage(), first.exc_info, first.stack_info) == ("first", None, None)
    assert (record.name, record.levelname) == ("actionkit", "ERROR")
    assert record.getMessage() == "one of 2"
    assert record.exc_info is not None
    assert str(record.exc_info[1]) == "the cause"
    assert record.stack_info == "here"
    assert before <= record.created <= after
    assert abs(record.msecs - record.created % 1 * 1000) < 1.0
    assert record.threadName == threading.current_thread().name
    assert record.thread == threading.get_ident()
    assert record.filename == "test_diagnostics.py"
    assert record.funcName == test_a_record_tells_who_logged_it_where_and_when.__name__


def test_records_keep_their_order_and_none_is_made_that_nobody_wants() -> None:
    records = EventLog[logging.LogRecord]()
    with handled_by(records.append):
        for number in range(200):
            diagnostics.log_later(logging.DEBUG, "%d", number)
            diagnostics.log_later(logging.WARNING, "%d", number)
        assert diagnostics.flush(soon())
    assert [record.getMessage() for record in records] == [str(n) for n in range(200)]


def test_the_thread_ends_when_all_is_written(own_threads: Callable[[], list[str]]) -> None:
    stuck = Stuck()
    with handled_by(stuck):
        diagnostics.log_later(logging.WARNING, "it")
        assert stuck.entered.wait(LONG)
        assert own_threads() == ["actionkit-log"]
        stuck.leave.set()
        assert diagnostics.flush(soon())
    until = soon()
    while own_threads():
        assert time.monotonic() < until
        NEVER.wait(0.005)


def test_a_stuck_handler_blocks_nobody_and_what_it_misses_is_counted(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(diagnostics, "MOST", 3)
    stuck = Stuck()
    with handled_by(stuck):
        for number in range(10):
            diagnostics.log_later(logging.WARNING, "%d", number)
            assert stuck.entered.wait(LONG)
        assert not diagnostics.flush(time.monotonic() + 0.02)
        stuck.leave.set()
        assert diagnostics.flush(soon())
    said = [record.getMessage() for record in stuck.records]
    assert said[:4] == ["0", "1", "2", "3"]
    assert said[4:] == ["6 messages of ActionKit's were left out: a log handler was blocked"]


@contextmanager
def filtered_by(decide: Callable[[logging.LogRecord], bool]) -> Iterator[None]:
    LOGGER.addFilter(decide)
    try:
        yield
    finally:
        LOGGER.removeFilter(decide)


@pytest.mark.parametrize("raising", [handled_by, filtered_by], ids=["handler", "filter"])
@pytest.mark.parametrize("log", [diagnostics.log_later, diagnostics.log_here])
def test_what_a_handler_or_a_filter_raises_goes_to_standard_error(
    log: Callable[..., None],
    raising: Callable[..., AbstractContextManager[None]],
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    seen: list[str] = []

    def raises(record: logging.LogRecord) -> bool:
        seen.append(record.getMessage())
        raise SystemExit("from the user")

    with raising(raises):
        for number in range(2):
            log(logging.WARNING, "%d", number)
        assert diagnostics.flush(soon())
        err = capsys.readouterr().err
        assert err.count("--- a handler or filter of the logger 'actionkit' raised ---") == 2
        assert "SystemExit: from the user" in err
        monkeypatch.setattr(logging, "raiseExceptions", False)  # `logging`'s own switch for it
        log(logging.WARNING, "2")
        assert diagnostics.flush(soon())
    assert capsys.readouterr().err == ""
    assert seen == ["0", "1", "2"]


def test_a_record_factory_is_the_users_and_runs_elsewhere_too() -> None:
    threads: list[str] = []

    def factory(*args: object, **kwargs: object) -> logging.LogRecord:
        threads.append(threading.current_thread().name)
        return logging.LogRecord(*args, **kwargs)  # type: ignore[arg-type]

    records = EventLog[logging.LogRecord]()
    before = logging.getLogRecordFactory()
    logging.setLogRecordFactory(factory)
    try:
        with handled_by(records.append):
            diagnostics.log_later(logging.WARNING, "it")
            records.wait_for(1)
    finally:
        logging.setLogRecordFactory(before)
    assert threads == ["actionkit-log"]


def test_where_no_thread_can_be_started_flushing_writes(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(thread: threading.Thread) -> None:
        raise RuntimeError("can't create new thread at interpreter shutdown")

    records = EventLog[logging.LogRecord]()
    monkeypatch.setattr(threading.Thread, "start", refuse)
    with handled_by(records.append):
        diagnostics.log_later(logging.WARNING, "1")
        diagnostics.log_later(logging.WARNING, "2")
        assert len(records) == 0
        assert diagnostics.flush(soon())
    assert [record.getMessage() for record in records] == ["1", "2"]


def test_a_human_need_not_wait_for_a_handler_at_the_exit(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(thread: threading.Thread) -> None:
        raise RuntimeError("can't create new thread at interpreter shutdown")

    records = EventLog[logging.LogRecord]()
    interrupts = [KeyboardInterrupt()]

    def emit(record: logging.LogRecord) -> None:
        if interrupts:
            raise interrupts.pop()
        records.append(record)

    monkeypatch.setattr(threading.Thread, "start", refuse)
    with handled_by(emit):
        for number in range(2):
            diagnostics.log_later(logging.WARNING, "%d", number)
        with pytest.raises(KeyboardInterrupt):
            diagnostics.flush(soon())
        assert diagnostics.flush(soon())  # and it is in good order
    assert [record.getMessage() for record in records] == ["1"]


FORKED = """
import logging, os, threading, time
from actionkit._threads import diagnostics

entered, seen = threading.Event(), []
class Handler(logging.Handler):
    def createLock(self):
        self.lock = threading.Semaphore(1000)
    def emit(self, record):
        seen.append(record.getMessage())
        if record.getMessage() == "parent":
            entered.set()
            threading.Event().wait()
logging.getLogger("actionkit").addHandler(Handler())
diagnostics.log_later(logging.WARNING, "parent")
entered.wait()
diagnostics.log_later(logging.WARNING, "parent too")
child = os.fork()
if child == 0:
    diagnostics.after_fork()
    diagnostics.log_later(logging.WARNING, "child")
    done = diagnostics.flush(time.monotonic() + 10)
    os._exit(0 if done and seen == ["parent", "child"] else 1)
print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
os._exit(0)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="there is no fork")
def test_the_child_of_a_fork_logs_for_itself() -> None:
    run = [sys.executable, "-W", "ignore::DeprecationWarning", "-c", FORKED]
    assert subprocess.run(run, capture_output=True, timeout=30, check=True).stdout == b"0\n"

"""Callbacks, observers and log handlers that block or raise delay nobody else (C1.8, C6.2)."""

from __future__ import annotations

import logging
import threading
from contextlib import ExitStack, contextmanager

import pytest

from actionkit import RetryPolicy
from actionkit._threads import in_hand
from actionkit.testing import EventLog
from tests.conftest import all_is_logged

LONG = 20.0  # the bound of a wait that is over soon when all is well
ONCE = RetryPolicy.none()
GOALS = logging.getLogger("actionkit.goal")
OURS = logging.getLogger("actionkit")


class Stuck:
    """Called as a callback, an observer or a log handler: does not return until it is let go."""

    def __init__(self):
        self.entered, self.leave = EventLog(), threading.Event()

    def __call__(self, *args):
        self.entered.append(args)
        self.leave.wait(120)

    def __repr__(self):
        return "<Stuck>"

    on_event = on_outcome = __call__


@pytest.fixture
def stuck(make_client):
    """Something that blocks, until the test is over; the clients are closed after that."""
    it = Stuck()
    yield it
    it.leave.set()


@contextmanager
def handled_by(logger, emit, level=logging.INFO):
    """Give a logger a handler that calls `emit`, without the lock that handlers have.

    So each thread that logs is inside `emit`, and none waits to enter it where nobody sees it.
    """

    class Handler(logging.Handler):
        def createLock(self):
            self.lock = threading.Semaphore(1000)

    handler, before = Handler(level), logger.level
    handler.emit = emit
    logger.addHandler(handler)
    logger.setLevel(level)
    try:
        yield
    finally:
        logger.removeHandler(handler)
        logger.setLevel(before)


def all_goes_on(client, events=None):
    """Make a call; return once feedback, result and done callback have come, in any order."""
    feedback, done = EventLog(), EventLog()
    future = client.call_async({"order": 5}, feedback, timeout=LONG)
    future.add_done_callback(done)
    assert list(future.result(LONG).sequence) == [0, 1, 1, 2, 3, 5]
    assert feedback.wait_for(1, LONG)
    assert done.wait_for(1, LONG) == [future]
    if events is not None:
        events.wait_for(lambda event: event.goal_id == future.goal_id, LONG)
    return future


# --- feedback and done callbacks ---------------------------------------------------------------


def block_with_feedback(client, goals, stuck, order=5):
    """Begin goals, and return when a callback of each blocks."""
    futures = [client.call_async({"order": order}, stuck, timeout=60) for _ in range(goals)]
    stuck.entered.wait_for(goals, LONG)
    return futures


@pytest.mark.long
def test_blocked_callbacks_of_one_client_hold_up_no_other(action_server, make_client, stuck):
    action_server("fibonacci", period=0.02)
    blocked = block_with_feedback(make_client(), 8, stuck)
    events, records = EventLog(), EventLog()
    other = make_client(observers=[events])
    with handled_by(GOALS, records):
        future = all_goes_on(other, events)
        records.wait_for(lambda record: record.goal_id == str(future.goal_id), LONG)
    assert all(future.result(LONG) for future in blocked)


@pytest.mark.long
def test_nor_other_goals_of_the_same_client_for_ever(action_server, make_client, stuck):
    action_server("fibonacci", period=0.5)
    client = make_client()
    block_with_feedback(client, 20, stuck, order=90)
    feedback, done = EventLog(), EventLog()
    future = client.call_async({"order": 90}, feedback, timeout=60)
    future.add_done_callback(done)
    assert len(feedback.wait_for(2, LONG)) >= 2
    future.cancel()
    assert done.wait_for(1, LONG) == [future]


@pytest.mark.long
def test_blocked_done_callbacks_hold_up_nobody(action_server, make_client, stuck):
    # Up to two seconds pass until the last of them count as blocked and are replaced. Feedback that
    # has not been handed over by the result is left out, so a goal has to take longer than that.
    server = action_server("fibonacci", period=0.6, gate=1)
    client = make_client()
    future = client.call_async({"order": 1}, timeout=60)
    server.wait_for("executing")
    for _ in range(20):
        future.add_done_callback(stuck)
    server.release()
    stuck.entered.wait_for(20, LONG)
    all_goes_on(client)
    all_goes_on(make_client())


@pytest.mark.long
def test_clients_that_do_nothing_have_no_threads(action_server, make_client, own_threads):
    action_server("fibonacci")
    clients = [make_client(observers=[EventLog()]) for _ in range(10)]
    for client in clients:
        all_goes_on(client)
    soon = threading.Event()
    for _ in range(int(LONG / 0.05)):
        if own_threads() == ["actionkit"]:
            break
        soon.wait(0.05)
    assert own_threads() == ["actionkit"]


# --- observers and log handlers ----------------------------------------------------------------


@pytest.mark.long
def test_clients_that_share_a_stuck_log_handler_go_on(action_server, make_client, stuck):
    action_server("fibonacci", period=0.02)
    clients = [make_client() for _ in range(8)]
    with handled_by(GOALS, stuck):
        for client in clients:
            assert client.call({"order": 1}, LONG)
        stuck.entered.wait_for(8, LONG)
        for client in (clients[0], clients[7], make_client()):
            all_goes_on(client)
        stuck.leave.set()


@pytest.mark.long
def test_stuck_observers_hold_up_no_other_observer(action_server, make_client, stuck):
    action_server("fibonacci", period=0.02)

    class Blocking:
        def on_event(self, event, call):
            stuck(event)

    events = EventLog()
    client = make_client(observers=[*(Blocking() for _ in range(10)), events])
    records = EventLog()
    with handled_by(GOALS, records):
        all_goes_on(client, events)
        stuck.entered.wait_for(10, LONG)
        assert records.wait_for(1, LONG)


@pytest.mark.long
def test_a_log_handler_that_raises_does_not_silence_the_log(action_server, make_client, caplog):
    action_server("fibonacci")
    records = EventLog()

    def emit(record):
        records.append(record)
        raise ValueError("from the handler")

    client = make_client()
    with handled_by(GOALS, emit):
        for _ in range(3):
            assert client.call({"order": 1}, LONG)
        client.close()  # by then all is told
    told = [record.state for record in records if record.kind == "event"]
    assert told == ["ACCEPTED", "SUCCEEDED"] * 3
    (warning,) = [r for r in caplog.records if r.name == "actionkit"]
    assert "the log 'actionkit.goal' of action '/fibonacci' raised" in warning.getMessage()
    assert warning.exc_info[0] is ValueError


# --- who blocks is named ------------------------------------------------------------------------


def use(how, client, stuck):
    """Make a call in which a function of the user blocks."""
    future = client.call_async({"order": 5}, stuck if how == "feedback" else None, timeout=LONG)
    if how == "done":
        future.add_done_callback(stuck)
    assert future.result(LONG)


@pytest.mark.long
@pytest.mark.parametrize(
    ("how", "named"),
    [
        ("feedback", f"on_feedback {__name__}.Stuck of action '/fibonacci'"),
        ("done", f"done callback {__name__}.Stuck of action '/fibonacci'"),
        ("observer", "observer <Stuck> of action '/fibonacci'"),
        ("log", "a handler of the log 'actionkit.goal' of action '/fibonacci'"),
    ],
    ids=["feedback", "done", "observer", "log"],
)
def test_the_log_names_what_blocks_once_when_more_comes(
    how, named, action_server, make_client, stuck, monkeypatch
):
    monkeypatch.setattr(in_hand, "WARN_AFTER", 0.1)
    action_server("fibonacci", period=0.05)
    told = EventLog()
    client = make_client(observers=[stuck] if how == "observer" else [])
    with ExitStack() as stack:
        if how == "log":
            stack.enter_context(handled_by(GOALS, stuck))
        stack.enter_context(handled_by(OURS, told, logging.WARNING))
        use(how, client, stuck)
        stuck.entered.wait_for(1, LONG)
        assert client.call({"order": 5}, LONG)  # it takes longer than 0.1 s
        warning = told.wait_for(lambda record: "has not returned" in record.getMessage(), LONG)
        assert warning.getMessage().startswith(named)
        assert "self.leave.wait(" in warning.stack_info  # where it stands
        assert client.call({"order": 5}, LONG)
        stuck.leave.set()
        client.close()
        assert all_is_logged()
        assert list(told) == [warning]


STUCK_AT_EXIT = """
import logging, sys, threading
from actionkit import Client
from test_msgs.action import Fibonacci

entered = threading.Event()
def blocks(record):
    entered.set()
    threading.Event().wait()
logger = logging.getLogger(sys.argv[1])
logger.setLevel(logging.INFO)
logger.addFilter(blocks)
client = Client(Fibonacci, "fibonacci")
client.call({"order": 2}, 20)
assert entered.wait(20)
"""


@pytest.mark.parametrize("logger", ["actionkit", "actionkit.goal"])
@pytest.mark.long
def test_a_log_filter_that_never_returns_does_not_hold_up_the_exit(
    logger, action_server, run_script
):
    action_server("twins")
    code, out, err = run_script(STUCK_AT_EXIT, logger).finish(timeout=30)
    assert (code, out) == (0, "")
    told = "at exit, a handler of the log 'actionkit.goal' of action '/fibonacci' had not been"
    lines = [line for line in err.splitlines() if line.startswith("at exit")]
    assert [line.startswith(told) for line in lines] == ([True] if "goal" in logger else [])


def test_ctrl_c_in_a_done_callback_on_the_main_thread_gets_through(action_server, make_client):
    action_server("fibonacci")
    future = make_client().call_async({"order": 1}, timeout=LONG)
    assert future.result(LONG)

    def interrupted(future):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        future.add_done_callback(interrupted)


# --- what the communication thread logs --------------------------------------------------------


@pytest.mark.long
def test_a_stuck_handler_does_not_stop_the_communication_thread(action_server, make_client, stuck):
    action_server("twins")
    with handled_by(OURS, stuck):
        client = make_client(retry=ONCE)
        assert client.wait_for_server(10)
        ((warning,), *_) = stuck.entered.wait_for(1, LONG)
        assert "has 2 servers" in warning.getMessage()
        all_goes_on(client)
        all_goes_on(make_client(retry=ONCE))
        client.close()
        stuck.leave.set()


@pytest.mark.long
def test_a_handler_that_raises_does_not_end_the_communication_thread(action_server, make_client):
    action_server("twins")
    raised = EventLog()

    def emit(record):
        raised.append(record)
        raise ValueError("from the handler")

    with handled_by(OURS, emit):
        client = make_client(retry=ONCE)
        assert client.wait_for_server(10)
        assert "has 2 servers" in raised.wait_for(1, LONG)[0].getMessage()
        all_goes_on(client)
        assert client._session.connection.runtime.failure is None

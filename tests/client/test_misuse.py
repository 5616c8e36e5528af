"""Wrong use: clear errors, before anything is sent (C1.9, C1.10, C2.1, C3)."""

from __future__ import annotations

import copy
import math
import pickle
import re

import pytest
import rclpy
from test_msgs.action import Fibonacci
from test_msgs.msg import BasicTypes

import actionkit as ak
from actionkit import Client, InvalidGoalError, RetryPolicy, Timeouts, Verdict
from actionkit.testing import EventLog


@pytest.mark.parametrize("bad", [-1, -0.001, math.inf, 1e300, 10**400, math.nan])
def test_a_bad_timeout(bad, make_client):
    client = make_client()
    for use in (client.call, client.call_async):
        with pytest.raises(ValueError, match="timeout="):
            use({"order": 1}, timeout=bad)
    with pytest.raises(ValueError, match="timeout="):
        client.wait_for_server(bad)


@pytest.mark.parametrize("bad", [1e300, 10**400, 10**5000], ids=["1e300", "1e400", "1e5000"])
def test_a_timeout_longer_than_any_clock_runs(bad, make_client):
    client = make_client()
    for use in (
        lambda: client.call({"order": 1}, timeout=bad),
        lambda: client.call_async({"order": 1}, timeout=bad),
        lambda: client.wait_for_server(bad),
    ):
        with pytest.raises(ValueError, match=r"^timeout=.* must be 1e9 or less; None means no"):
            use()
    assert client.pending == 0


@pytest.mark.long
def test_the_longest_timeouts_work(action_server, make_client):
    action_server("fibonacci", period=0.01)
    most = 1e9
    timeouts = Timeouts(
        server=most, accept=most, total=most, feedback=most, cancel=most, liveness=most
    )
    client = make_client(timeouts=timeouts)
    assert client.wait_for_server(most)
    assert list(client.call({"order": 2}, timeout=most).sequence) == [0, 1, 1]
    for wait in (1e300, 10**400, math.inf):  # a local wait: as good as one without a limit
        future = client.call_async({"order": 2})
        assert future.outcome(wait).ok
        assert list(future.result(wait).sequence) == [0, 1, 1]
        assert future.exception(wait) is None


@pytest.mark.parametrize("at", [1e300, math.inf])
def test_a_timer_beyond_all_clocks_does_not_end_the_thread(at, make_client):
    """A user's `wait=` strategy may return any pause."""
    client = make_client()
    runtime = client._session.connection.runtime
    handle = runtime.run(lambda: runtime.call_at(at, lambda: None))
    assert not client.server_is_ready()
    assert runtime.failure is None
    runtime.run(lambda: runtime.timers.cancel(handle))


def test_a_timeout_of_the_wrong_type(make_client):
    with pytest.raises(TypeError, match="timeout='1'"):
        make_client().call({"order": 1}, timeout="1")


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy])
def test_a_client_is_not_copied(copied, make_client):
    client = make_client()
    with pytest.raises(TypeError, match="use the same one everywhere"):
        copied(client)
    assert not client.closed


def test_clients_and_futures_say_what_to_pickle_instead(make_client):
    client = make_client()
    future = client.call_async({"order": "no number"})
    with pytest.raises(TypeError, match="make one in the process that uses it"):
        pickle.dumps(client)
    with pytest.raises(TypeError, match=r"pickle the result or outcome\(\)"):
        pickle.dumps(future)
    assert pickle.loads(pickle.dumps(future.outcome())).status == future.state


def test_a_goal_can_be_checked_without_a_call(make_client):
    client = make_client()
    given = Fibonacci.Goal(order=3)
    checked = client.check_goal(given)
    assert checked == given
    assert checked is not given
    assert client.check_goal({"order": 3}) == given
    with pytest.raises(InvalidGoalError, match=r"nothing was sent: order: ") as caught:
        client.check_goal({"order": "three"})
    assert caught.value.field == "order"
    assert str(caught.value) == str(client.call_async({"order": "three"}).exception(10.0))
    assert client.pending == 0


def test_calling_from_a_callback(action_server, make_client):
    action_server("fibonacci", period=0.01)
    client = make_client()
    seen: EventLog = EventLog()

    def call_again(_):
        try:
            client.call({"order": 1}, 10)
        except RuntimeError as error:
            seen(error)
        seen(client.call_async({"order": 1}))

    assert client.call({"order": 3}, 10, on_feedback=call_again)
    error, future = seen.wait_for(2)[:2]
    assert "call_async" in str(error)
    assert list(future.result(10).sequence) == [0, 1]
    done: EventLog = EventLog()
    client.call_async({"order": 1}).add_done_callback(lambda f: call_again(f) or done(f))
    assert done.wait_for(1)


def test_after_close(make_client):
    client = make_client()
    client.close()
    client.close()
    for use in (
        lambda: client.call({"order": 1}),
        lambda: client.call_async({"order": 1}),
        lambda: client.wait_for_server(1),
        client.server_is_ready,
        client.cancel_all,
    ):
        with pytest.raises(ak.ClientClosedError, match="'/fibonacci' is closed"):
            use()
    assert client.pending == 0
    assert "closed" in repr(client)


@pytest.mark.parametrize("bad", [BasicTypes, Fibonacci.Goal, "Fibonacci", None])
def test_a_bad_action_type(bad, ros_domain):
    with pytest.raises(TypeError, match="must be an action class"):
        Client(bad, "fibonacci")


@pytest.mark.parametrize("bad", ["", "9lives", "a b", "a//b", "fib/", "ü", "a\0b", "a\ud800"])
def test_a_bad_name(bad, ros_domain):
    with pytest.raises(ValueError, match="action_name="):
        Client(Fibonacci, bad)


@pytest.mark.parametrize("bad", ["a\0b", "\0", "a\n", "\x1b[31ma", "a\x7f", "a\x9b", "a\ud800"])
def test_a_name_with_characters_that_cannot_be_seen(bad, ros_domain):
    """The middleware reads a name up to its first NUL: another action would be called."""
    told = rf"^action_name={re.escape(repr(bad))} .* Remove "
    with pytest.raises(ValueError, match=told):
        Client(Fibonacci, bad)
    context = rclpy.Context()
    rclpy.init(context=context)
    node = rclpy.create_node("somebody", context=context)
    try:
        with pytest.raises(ValueError, match=told):
            Client(Fibonacci, bad, node=node)
    finally:
        node.destroy_node()
        rclpy.shutdown(context=context)


def test_bad_arguments_of_the_client(ros_domain):
    with pytest.raises(TypeError, match="action_name=3"):
        Client(Fibonacci, 3)
    with pytest.raises(TypeError, match="timeouts=3"):
        Client(Fibonacci, "f", timeouts=3)
    with pytest.raises(TypeError, match="retry=3"):
        Client(Fibonacci, "f", retry=3)
    with pytest.raises(TypeError, match="classify=3"):
        Client(Fibonacci, "f", classify=3)
    with pytest.raises(TypeError, match=r"classify=.* this is a class"):
        Client(Fibonacci, "f", classify=Verdict)

    async def judge(outcome):
        return Verdict.SUCCESS

    with pytest.raises(TypeError, match=r"classify=.* this is a coroutine function"):
        Client(Fibonacci, "f", classify=judge)
    for budget in (5, 0, "5"):
        with pytest.raises(TypeError, match=f"retry_budget={budget!r} must be a RetryBudget"):
            Client(Fibonacci, "f", retry_budget=budget)
    with pytest.raises(ValueError, match="on_close='stop'"):
        Client(Fibonacci, "f", on_close="stop")
    with pytest.raises(TypeError, match="node="):
        Client(Fibonacci, "f", node="my_node")
    with pytest.raises(ValueError, match=r"Timeouts\.accept"):
        Timeouts(accept=-1)
    with pytest.raises(ValueError, match=r"RetryPolicy\.attempts"):
        RetryPolicy(attempts=0)


def test_the_name_with_two_types_in_one_process(make_client):
    from test_msgs.action import NestedMessage

    make_client(Fibonacci, "same")
    with pytest.raises(ak.ActionTypeMismatchError, match="this process"):
        make_client(NestedMessage, "same")


def test_a_bad_domain(monkeypatch):
    monkeypatch.setenv("ROS_DOMAIN_ID", "seven")
    with pytest.raises(ValueError, match="ROS_DOMAIN_ID='seven'"):
        Client(Fibonacci, "fibonacci")

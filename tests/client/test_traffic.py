"""What others do on the same action costs a client next to nothing (C7.2, C7.4)."""

from __future__ import annotations

import threading

import pytest

from actionkit import Client, RetryPolicy
from actionkit._ros.communication.runtime import Runtime


def turns(client: Client, monkeypatch: pytest.MonkeyPatch) -> list[None]:
    """Return a list that grows with each turn of the client's communication thread."""
    seen: list[None] = []
    original = Runtime._turn

    def turn(self: Runtime) -> None:
        seen.append(None)
        original(self)

    monkeypatch.setattr(Runtime, "_turn", turn)
    return seen


OTHERS = """
import sys
from actionkit import Client
from test_msgs.action import Fibonacci
with Client(Fibonacci, "fibonacci") as client:
    future = client.call_async({"order": 90})
    for number, _ in enumerate(future.feedback()):
        if number == 5:
            print("flowing", flush=True)
    print("over", flush=True)
"""


@pytest.mark.long
def test_an_idle_client_sleeps_through_the_feedback_of_others(
    action_server, make_client, run_script, monkeypatch
):
    # The event that tells of servers and the messages wake a wait by one condition of the
    # reader: with messages unread, a wait for the event alone never waits.
    action_server("fibonacci", period=0.02)
    client = make_client()
    assert client.wait_for_server(20)
    seen = turns(client, monkeypatch)
    other = run_script(OTHERS)
    assert other.line() == "flowing"
    before = len(seen)
    assert other.line() == "over"  # some 80 messages and 1.6 s later
    assert len(seen) - before <= 10


@pytest.mark.long
def test_an_idle_client_sees_a_new_server_in_spite_of_the_feedback_of_others(
    action_server, make_client, run_script
):
    server = action_server("fibonacci", period=0.02)
    client = make_client(retry=RetryPolicy(resend="server_gone"))  # it may not have seen the end
    assert client.wait_for_server(20)
    other = run_script(OTHERS)
    assert other.line() == "flowing"
    server.restart()
    assert client.call({"order": 3}, 20)
    server.wait_for("succeeded")


@pytest.mark.long
def test_feedback_comes_through_that_of_others(action_server, make_client, run_script):
    action_server("fibonacci", period=0.02)
    client = make_client()
    other = run_script(OTHERS)
    assert other.line() == "flowing"
    seen: list[int] = []
    first = threading.Event()

    def note(feedback) -> None:
        seen.append(len(feedback.sequence))
        first.set()

    future = client.call_async({"order": 20}, timeout=20, on_feedback=note)
    assert first.wait(20)
    assert not future.done()  # it comes while the goal runs, not with the result
    assert len(future.result().sequence) == 21
    assert seen == sorted(set(seen))
    assert len(seen) > 10

"""The goal of a request, and the meaning of its answer."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from actionkit._goal.stages import CONFIRMED_AFTER
from actionkit._model.cancel_answer import CancelAnswer
from actionkit._ros.cancelling.cancels import CancelWindow
from actionkit._ros.sending.requests import ServiceRequests
from actionkit._ros.servers_in_sight.readiness import UNNAMED
from tests.unit import clock
from tests.unit.call_life import CallLife

KEY = bytes(range(16))


class Client:
    """Gives each request a number."""

    def __init__(self) -> None:
        self.requests: list[Any] = []

    def send(self, request: Any) -> int:
        self.requests.append(request)
        return len(self.requests)


class Thread(clock.CommunicationThread):
    """A communication thread, and what is seen on it."""

    def __init__(self) -> None:
        super().__init__()
        self.servers = 1
        self.unnamed = False
        self.cancelled: list[bytes] = []

    def window(self, kind: type[CancelWindow], action_name: str) -> CancelWindow:
        return kind()


@pytest.fixture
def thread() -> Thread:
    return Thread()


@pytest.fixture
def goal_source() -> Client:
    return Client()


@pytest.fixture
def requests(thread: Thread, goal_source: Client) -> ServiceRequests:
    entities = SimpleNamespace(
        goal=goal_source, result=Client(), cancel=Client(), feedback=object()
    )
    request = SimpleNamespace(Request=SimpleNamespace)
    impl = SimpleNamespace(SendGoalService=request, GetResultService=request)
    made = ServiceRequests(
        thread,  # type: ignore[arg-type]
        entities,  # type: ignore[arg-type]
        impl,
        action_name="/arm",
        count_servers=lambda: thread.servers,
        servers=lambda: (
            UNNAMED if thread.unnamed else frozenset(bytes([n]) for n in range(thread.servers))
        ),
        on_cancel_sent=thread.cancelled.append,
    )
    made.send_goal(KEY, object())
    return made


def test_what_was_asked_before_is_outdated_when_asked_anew(
    requests: ServiceRequests, thread: Thread
) -> None:
    requests.ask_result(KEY)
    requests.ask_result(KEY)  # at a measured pace, and so not at once
    requests.ask_result(KEY, supersedes_earlier=True)
    thread.advance(1.0)
    assert [requests.is_outdated(seq) for seq in (1, 2, 3)] == [True, False, False]
    # A result counts all the same.
    answered = [requests.answered("result", seq)[0] for seq in (1, 2, 3, 4)]
    assert answered == [KEY, KEY, KEY, None]
    assert not requests.is_outdated(1)


def test_a_forgotten_goal_leaves_nothing_behind(requests: ServiceRequests, thread: Thread) -> None:
    requests.ask_result(KEY)
    requests.ask_result(KEY, supersedes_earlier=True)
    requests.cancels.ask(KEY)
    requests.forget(KEY)
    requests.ask_result(KEY)
    thread.advance(1.0)
    assert not any(requests.table_sizes().values())


def test_each_cancel_request_is_told_of_also_those_that_are_repeated(
    requests: ServiceRequests, thread: Thread
) -> None:
    """These, without the unsuccessful ones, say whether a cancellation was ours (C4.4)."""
    requests.cancels.ask(KEY)
    assert thread.cancelled == [KEY]
    sent = thread.now()
    thread.advance(0.1)
    assert requests.cancel_answered(1, CancelAnswer.UNKNOWN_GOAL)[:2] == (KEY, sent)
    thread.advance(0.3)
    assert thread.cancelled == [KEY, KEY]


def test_unheard_is_since_the_first_that_was_not_answered(
    requests: ServiceRequests, thread: Thread
) -> None:
    assert requests.unheard_since is None
    thread.advance(1.0)
    requests.probe()
    thread.advance(1.0)
    requests.cancels.ask(KEY)
    assert requests.unheard_since == thread.now() - 1.0
    requests.heard()
    assert requests.unheard_since is None


def test_a_second_server_that_accepts_a_goal_is_told_of_also_one_that_was_not_in_sight(
    requests: ServiceRequests, thread: Thread
) -> None:
    assert requests.goal_answered(1, accepted=True) == KEY
    assert requests.goal_answered(1, accepted=True) == KEY
    requests.forget(KEY)
    assert not any(requests.table_sizes().values())


def test_a_server_that_is_not_in_sight_yet_may_accept_what_all_others_have_rejected(
    requests: ServiceRequests,
) -> None:
    assert requests.goal_answered(1, accepted=False) == KEY
    assert requests.goal_answered(1, accepted=True) == KEY


def test_an_answer_counts_for_everybody_when_each_server_has_given_one(
    requests: ServiceRequests, thread: Thread
) -> None:
    thread.servers = 2
    requests.ask_result(KEY)
    thread.servers = 3  # one came after the request, and may have been sent it all the same
    told = [requests.answered("result", 1, knows=ended) for ended in (False, True, True)]
    assert [(each.everybody, each.knowing) for each in told] == [(False, 0), (False, 1), (True, 2)]
    assert requests.answered("result", 1).key is None


def test_servers_whose_names_are_not_known_so_far_are_counted_too(
    requests: ServiceRequests, thread: Thread
) -> None:
    thread.servers, thread.unnamed = 2, True
    requests.ask_result(KEY)
    assert [requests.answered("result", 1).everybody for _ in range(2)] == [False, True]


@pytest.mark.parametrize("first", [CancelAnswer.ACCEPTED, CancelAnswer.UNKNOWN_GOAL])
def test_a_goal_is_not_unknown_where_one_of_two_servers_knows_it(
    requests: ServiceRequests, thread: Thread, first: CancelAnswer
) -> None:
    thread.servers = 2
    requests.cancels.ask(KEY)
    requests.cancel_answered(1, first, elsewhere=first is CancelAnswer.UNKNOWN_GOAL)
    last = requests.cancel_answered(1, CancelAnswer.UNKNOWN_GOAL, elsewhere=True)
    assert last.everybody == (first is CancelAnswer.UNKNOWN_GOAL)


def test_late_acceptances_are_waited_for_where_there_are_several_servers(
    requests: ServiceRequests, thread: Thread, goal_source: object
) -> None:
    requests.goal_answered(1, accepted=True)
    requests.forget(KEY, "kept")
    assert goal_source not in thread.sources  # an idle client costs no turn
    thread.servers = 2
    requests.server_came()
    assert goal_source in thread.sources
    requests.send_goal(bytes(16), object())
    requests.goal_answered(2, accepted=False)
    assert goal_source in thread.sources
    thread.servers = 1
    requests.forget(bytes(16), "kept")
    assert goal_source not in thread.sources


@pytest.mark.parametrize("again", [False, True])
def test_the_late_acceptance_of_a_forgotten_goal_is_told_of_once(
    requests: ServiceRequests, again: bool
) -> None:
    requests.forget(KEY, "kept")
    assert requests.goal_answered(1, accepted=True) is None
    assert requests.released(1) == "kept"
    assert requests.released(1) is None
    if again:
        requests.follow(KEY, 1)  # now its owner hears of a third server, too
        assert requests.goal_answered(1, accepted=True) == KEY


def test_nothing_is_kept_of_a_goal_that_was_left_running(
    requests: ServiceRequests, thread: Thread, goal_source: object
) -> None:
    thread.servers = 2
    requests.forget(KEY)
    assert requests.released(1) is None
    requests.server_came()
    assert goal_source not in thread.sources


def test_the_newest_that_were_forgotten_are_kept(requests: ServiceRequests) -> None:
    for number in range(1000):
        requests.send_goal(number.to_bytes(16, "big"), object())
        requests.forget(number.to_bytes(16, "big"), number)
    kept = [requests.released(2 + number) for number in range(1000)]
    assert [number for number in kept if number is not None] == list(range(1000 - 64, 1000))


@pytest.mark.parametrize("server", ["there", "lost", "back"])
def test_a_late_answer_to_an_early_question_ends_nothing(server: str) -> None:
    """A server that did not know the goal yet, with a delayed answer."""
    life = CallLife()
    life.ready()
    life.accepted(0)
    attempt = life.call.machine.attempt
    assert attempt is not None
    if server != "there":
        life.gone()
    if server == "back":
        life.back()
    life.does(attempt.on_result, None, None, life.now(), outdated=True)
    assert attempt.goal.in_flight
    life.result(0, None)
    if server == "there":
        life.wait_until(life.now() + CONFIRMED_AFTER)
        life.result(0, None)  # it says so again
    # Of a lost goal only its own server can say so.
    assert attempt.goal.in_flight == (server == "lost")

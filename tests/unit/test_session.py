"""What a session watches of its goals, and when a closed one releases its place on the thread."""

from __future__ import annotations

import math
import threading
import time
import uuid
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any, cast

import pytest

from actionkit import GoalState, RetryBudget, RetryPolicy, Timeouts, retry_aborted
from actionkit._calls.ending.closing import end_calls
from actionkit._calls.futures.goals_left import LINGER
from actionkit._calls.sending.attempt import Attempt, CallForgotten
from actionkit._calls.sending.request import Request
from actionkit._calls.sending.session import Session, open_sessions
from actionkit._goal.facts import GoalFacts
from actionkit._goal.stages import CancelReason, Stage
from actionkit._threads.pool import Pool
from tests.unit.clock import Clock


class Link:
    """Two servers, both of which have the goals."""

    others_confirmed_at = -math.inf

    def __init__(self, runtime: Clock) -> None:
        self.runtime = runtime
        self.cancelled: list[uuid.UUID] = []
        self.forgotten: list[GoalFacts | None] = []

    def send_goal(self, *_: object) -> int:
        return 2

    follow_goal = send_goal

    def ask_cancel(self, attempt: Attempt, *, urgent: bool) -> None:
        self.cancelled.append(attempt.goal_id)

    def sees_server_of(self, attempt: Attempt) -> bool:
        return True

    def forget(self, attempt: Attempt, keep: GoalFacts | None) -> None:
        self.forgotten.append(keep)

    def __getattr__(self, name: str) -> Callable[..., None]:
        return lambda *_, **__: None


@pytest.fixture(autouse=True)
def _not_at_exit() -> Iterator[None]:
    """Leave nothing that the interpreter's exit, which ends all sessions, cannot end."""
    before = set(open_sessions)
    yield
    open_sessions.intersection_update(before)


class World(Clock):
    """A session over a connection; with `late`, a second server accepts a goal after its end."""

    def __init__(self, on_close: str = "cancel", *, late: bool = True) -> None:
        super().__init__()
        self.time = time.monotonic()
        self.link = Link(self)
        self.freed = threading.Event()
        self.connection = SimpleNamespace(
            identity=SimpleNamespace(action_name="/arm", type_name="some/action/Arm", label=""),
            link=self.link,
            freed=self.freed,
            free=self.freed.set,
            decode_feedback=None,
            runtime=SimpleNamespace(
                call_soon=lambda callback: callback(),
                call_at=self.call_at,
                cancel_timer=self.queue.cancel,
                failure=None,
                was_shut_down=False,
                on_failure=[],
                on_shutdown=[],
            ),
            end_waits=lambda: None,
            end_spinning=lambda: None,
            why_unusable=lambda: "",
        )
        self.session = Session(self.connection, on_close, 1.0)  # type: ignore[arg-type]
        self.facts = GoalFacts(uuid.uuid4(), accepted=True, yeses=1, ended=True, ends=1, over=True)
        if late:
            self.accepted_late()

    def accepted_late(self) -> None:
        self.link.on_accepted_late(1, self.facts)

    @property
    def attempt(self) -> Attempt:
        watched = self.session.watched(self.facts.goal_id)
        assert watched is not None
        return watched

    def both_answer(self) -> None:
        """Both servers have ended the goal."""
        self.attempt.on_result(GoalState.CANCELED, None, self.time + 1.0, ends=2)


def test_a_goal_that_a_second_server_accepts_after_its_end_is_cancelled_and_watched() -> None:
    world = World(late=False)
    assert world.facts.known_to_run is False
    world.accepted_late()
    assert world.link.cancelled == [world.facts.goal_id]
    assert world.facts.known_to_run is True
    assert world.session.take_untold() == [("/arm", world.facts.goal_id)]
    world.advance(1.0)
    assert len(world.link.cancelled) == 2  # until it is known to have stopped
    world.both_answer()
    assert world.facts.known_to_run is False
    assert world.session.watched(world.facts.goal_id) is None
    assert world.link.forgotten == [world.facts]  # a third server may accept it, too
    world.session.release()
    assert len(world.queue) == 0


def test_it_is_told_that_a_goal_is_lost_also_if_that_follows_from_time_only() -> None:
    world = World()
    told = list[object]()
    world.session.on_goals_changed.add(lambda: told.append(world.attempt.goal.stage))
    for _ in range(8):
        world.attempt.on_result(None, None, world.time + 1.0, answers=1)
        world.advance(16.0)
    assert told == [Stage.LOST]
    world.session._free()


def test_a_call_that_has_attached_to_a_goal_that_is_accepted_late_decides() -> None:
    world = World()
    attempt = world.attempt
    world.accepted_late()
    assert world.attempt is attempt
    assert world.facts.yeses == 3
    world.session._free()


def test_a_goal_that_is_left_on_purpose_is_not_cancelled_elsewhere() -> None:
    world = World(late=False)
    link: Any = world.link
    attempt = Attempt(link, uuid.uuid4(), Timeouts(), CallForgotten(), on_change=lambda _: None)
    attempt.send(object())
    attempt.start()
    attempt.give_up(CancelReason.CLOSED, abandon=True)
    assert world.link.forgotten == [None]


def test_it_stays_while_goals_are_cancelled_on_a_second_server() -> None:
    world = World()
    world.session.release()
    assert not world.freed.is_set()
    world.both_answer()
    assert world.freed.is_set()


def test_but_not_for_ever() -> None:
    world = World()
    world.session.release()
    assert not world.freed.is_set()
    assert world.session in open_sessions
    world.advance(LINGER + 1)
    assert world.freed.is_set()
    assert world.session not in open_sessions


def test_nothing_keeps_it_otherwise() -> None:
    world = World(late=False)
    world.session.release()
    assert world.freed.is_set()


def test_closing_does_not_wait_after_ctrl_c_has_ended_such_a_wait() -> None:
    """Who has pressed it twice would have to press it once more (C2.5)."""
    worlds = World(), World()
    worlds[1].session.interrupted_at = time.monotonic()
    first, second = (end_calls([world.session]) for world in worlds)
    for world in worlds:
        world.advance(LINGER + 10)
        assert world.freed.is_set()
    assert (first > 0, second) == (True, 0)


@pytest.mark.parametrize(("on_close", "waits"), [("cancel", False), ("abandon", True)])
def test_goals_are_let_run_only_when_nobody_has_heard_of_ctrl_c(on_close: str, waits: bool) -> None:
    """rclpy's handler shuts ROS down before a blocking call hears of Ctrl-C (C2.5)."""
    world, closed = World(on_close, late=False), list[bool]()

    class InFlight:
        def close(self, *, abandon: bool, because: str) -> None:
            closed.append(abandon)

    world.session.calls.add(cast(Any, InFlight()))
    world.connection.why_unusable = lambda: "ROS was shut down"
    world.session._look_at_ros()
    assert closed == ([] if waits else [False])
    world.advance(1.0)
    assert closed == [waits]
    world.session.calls.clear()
    world.session.release()
    assert world.session not in open_sessions


def test_what_was_freed_is_held_by_no_timer() -> None:
    """Else each closed client stays in memory for as long as its timer runs."""
    world = World()
    world.session.release()
    assert len(world.queue) == 2  # of the session, and of the goal
    world.both_answer()
    assert world.freed.is_set()
    assert len(world.queue) == 0


def test_what_is_freed_at_once_arms_no_timer() -> None:
    world = World(late=False)
    world.session.release()
    assert world.freed.is_set()
    assert len(world.queue) == 0


def test_one_that_cannot_go_on_is_kept_until_it_is_closed() -> None:
    """The interpreter's exit names goals that nobody was told of."""
    world = World()
    world.session._on_failure(SystemExit("for the test"))
    assert world.freed.is_set()
    assert world.session in open_sessions
    world.session.release()
    assert world.session not in open_sessions


@pytest.mark.parametrize(
    ("settings", "watched"),
    [
        ({}, False),
        ({"classify": retry_aborted()}, True),
        ({"timeouts": Timeouts(feedback=1.0)}, True),
        ({"retry": RetryPolicy(resend="server_gone")}, True),
        ({"retry": RetryPolicy.none(), "timeouts": Timeouts(feedback=1.0)}, False),
    ],
    ids=["nothing", "a judge", "a limit of silence", "the server may go", "no retries"],
)
def test_what_may_be_sent_again_is_watched_from_the_beginning(
    settings: dict[str, Any], watched: bool
) -> None:
    """Else a goal that somebody cancels in its first second would be sent again (C4.4)."""
    usual = {"timeouts": Timeouts(), "retry": RetryPolicy(), "classify": None}
    rest = {"budget": RetryBudget(), "callbacks": None, "pool": Pool(), "function_pool": Pool()}
    request = Request(goal=object(), invalid=None, timeout=None, **usual | rest | settings)
    owner: Any = SimpleNamespace(unwanted=False)
    session = World().session
    attempt = session.send(uuid.uuid4(), request, owner)
    open_sessions.discard(session)
    assert attempt.goal.watched_early is watched

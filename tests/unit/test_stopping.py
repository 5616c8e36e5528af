"""How `actionkit stop` handles servers' answers, on a clock of the test."""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import nullcontext
from functools import partial
from io import StringIO
from types import SimpleNamespace
from typing import Any, cast

import pytest

from actionkit._model.cancel_answer import CancelAnswer
from actionkit._ros.cancelling.cancel import AllSaid, CancelSaid
from actionkit._ros.cancelling.cancel_goals import cancel_goals
from actionkit._ros.cancelling.cancelling import Cancelling
from actionkit._ros.holds.state import Hold, HoldState, Sender, encode
from actionkit._ros.holds.view import Said
from actionkit._ros.others_goals.watch import GoalSeen
from actionkit.cli._shared.exits import Exit
from actionkit.cli.cancel_and_stop import _keeper, stop
from actionkit.cli.cancel_and_stop._holding import agents_told, release
from actionkit.cli.cancel_and_stop._stop_table import exit_of, table, worst

LONG = 30.0


ONE, TWO = "00000000-0000-0000-0000-000000000001", "00000000-0000-0000-0000-000000000002"


def stopping(*states: str) -> Cancelling:
    action = Cancelling("/a")
    action.seen(["/server"])
    action.take_news(("/server",), 0.0)
    action.take_news([GoalSeen(g, s, 0) for g, s in zip((ONE, TWO), states, strict=False)], 0.0)
    return action


def goal_is(action: Cancelling, state: str, goal_id: str = ONE) -> None:
    action.take_news([GoalSeen(goal_id, state, 0)], 0.0)


def test_a_request_is_repeated_until_it_is_answered() -> None:
    action = stopping("EXECUTING")
    assert action.to_ask(0.0) == 1
    assert action.to_ask(0.5) is None
    assert action.to_ask(1.5) == 2
    assert not action.done
    action.take_all(AllSaid(2, (ONE,)), 1.6)
    assert action.to_ask(3.0) is None
    goal_is(action, "CANCELED")
    action.settle(3.0, over=False)
    assert action.done
    assert [fate.cancel for fate in action.fates] == ["CONFIRMED"]
    assert exit_of(action) is Exit.OK


def test_goals_accepted_meanwhile_are_canceled_too() -> None:
    action = stopping()
    assert action.to_ask(0.0) == 1
    action.take_all(AllSaid(1, ()), 0.1)
    assert action.done
    goal_is(action, "EXECUTING")
    assert action.to_ask(0.2) == 2
    assert not action.done
    action.take_all(AllSaid(2, (ONE,)), 0.3)
    goal_is(action, "CANCELED")
    action.settle(0.3, over=False)
    assert action.done
    action.once_more()
    assert not action.done
    assert action.to_ask(0.4) == 3


def test_what_a_server_says_of_all_is_no_proof_about_one() -> None:
    action = stopping("EXECUTING", "EXECUTING")
    assert action.to_ask(0.0) == 1
    action.take_all(AllSaid(1, (TWO,)), 0.1)
    assert action.to_ask_singly(0.2) == []
    assert sorted(action.to_ask_singly(0.6)) == [ONE, TWO]
    assert action.to_ask_singly(0.7) == []
    for goal_id in (ONE, TWO):
        action.take(CancelSaid(goal_id, CancelAnswer.REFUSED), 0.7)
    action.settle(2.0, over=False)
    assert {fate.cancel for fate in action.fates} == {"REFUSED"}
    assert exit_of(action) is Exit.CANCEL_REFUSED


@pytest.mark.parametrize("servers", [1, 2])
def test_a_goal_without_a_status_has_stopped_when_its_server_has_forgotten_it(servers: int) -> None:
    """So servers of micro-ROS do, which show no status."""
    action = Cancelling("/a", [ONE])
    action.seen(["/server"] * servers)
    assert action.to_ask_singly(0.0) == []
    assert action.to_ask_singly(1.0) == [ONE]
    action.take(CancelSaid(ONE, CancelAnswer.ACCEPTED), 1.1)
    assert action.to_ask_singly(2.0) == []
    assert action.to_ask_singly(2.2) == [ONE]
    action.take(CancelSaid(ONE, CancelAnswer.TERMINATED), 2.3)
    assert action.settle(2.4, over=False) == []
    assert action.to_ask_singly(3.4) == [ONE]
    action.take(CancelSaid(ONE, CancelAnswer.UNKNOWN_GOAL), 3.5)  # of two, it may be the other
    assert [fate.cancel for fate in action.settle(9.0, over=True)] == [
        "CONFIRMED" if servers == 1 else "UNKNOWN"
    ]


@pytest.mark.parametrize("answer", [CancelAnswer.UNKNOWN_GOAL, CancelAnswer.ACCEPTED])
def test_a_goal_that_is_seen_to_run_after_an_answer_is_asked_again(answer: CancelAnswer) -> None:
    """It was accepted later, or by another server than the one that has agreed."""
    action = Cancelling("/a", [ONE], may_come=True)
    action.seen(["/server", "/second"])
    action.to_ask_singly(0.0)
    assert action.to_ask_singly(1.0) == [ONE]
    action.take(CancelSaid(ONE, answer), 1.1)
    goal_is(action, "EXECUTING")
    assert action.to_ask_singly(2.0) == []
    assert action.to_ask_singly(2.2) == [ONE]
    assert action.to_ask_singly(3.0) == []
    assert action.to_ask_singly(3.3) == [ONE]
    goal_is(action, "CANCELING")
    assert action.to_ask_singly(9.0) == []


def test_a_goal_that_a_server_without_status_is_just_accepting_is_asked_for_again() -> None:
    """Servers of micro-ROS answer meanwhile that it has ended."""
    action = Cancelling("/a", [ONE])
    action.seen(["/server"])
    action.to_ask_singly(0.0)
    assert action.to_ask_singly(1.0) == [ONE]
    action.take(CancelSaid(ONE, CancelAnswer.TERMINATED), 1.1)
    assert action.to_ask_singly(2.0) == []
    assert action.to_ask_singly(2.2) == [ONE]


def test_what_one_of_two_servers_does_not_know_may_be_on_the_other() -> None:
    action = Cancelling("/a", [ONE])
    action.seen(["/server", "/second"])
    assert action.to_ask_singly(0.0) == []
    assert action.to_ask_singly(1.0) == [ONE]
    for request in (1, 2):  # both answers may be of the same server
        action.take(CancelSaid(ONE, CancelAnswer.UNKNOWN_GOAL, request), 1.1)
    assert action.settle(4.0, over=False) == []
    action.take(CancelSaid(ONE, CancelAnswer.UNKNOWN_GOAL, 2), 4.1)
    assert [fate.cancel for fate in action.settle(6.0, over=False)] == ["NO_SUCH_GOAL"]


def test_a_refusal_excuses_no_server_that_cannot_cancel_all() -> None:
    action = stopping("EXECUTING")
    action.seen(["/server", "/second"])
    action.take_news(("/second", "/server"), 0.0)
    assert action.to_ask(0.0) == 1
    for code in (1, 2):
        action.take_all(AllSaid(1, (), code=code), 0.1)
    assert action.to_ask_singly(1.0) == [ONE]
    action.take(CancelSaid(ONE, CancelAnswer.REFUSED), 1.1)
    action.settle(3.0, over=True)
    assert "2 of 2 servers cannot, or will not, cancel all goals" in action.unheard
    assert "(return code 1, 2, of /second, /server)" in action.unheard


def test_a_server_that_says_nothing_may_have_goals() -> None:
    action = stopping()
    action.to_ask(0.0)
    action.settle(9.0, over=True)
    assert not action.done
    assert exit_of(action) is Exit.CANCEL_UNKNOWN
    assert "GOALS MAY STILL BE RUNNING" in table([action])[-1]


def test_every_server_on_the_name_has_to_answer() -> None:
    action = stopping()
    action.seen(["/server", "/second"])
    action.take_news(("/second", "/server"), 0.0)
    assert action.to_ask(0.0) == 1
    action.take_all(AllSaid(1, ()), 0.1)
    assert not action.done
    assert action.to_ask(1.1) == 2
    action.take_all(AllSaid(2, ()), 1.2)
    assert not action.done
    action.settle(9.0, over=True)
    assert exit_of(action) is Exit.CANCEL_UNKNOWN
    assert "1 of 2 servers did not answer. GOALS MAY STILL BE RUNNING" in table([action])[-1]
    action.take_all(AllSaid(1, ()), 1.3)  # late, and as good
    assert action.done
    action.once_more()
    assert action.to_ask(1.4) == 3
    assert exit_of(action) is Exit.CANCEL_UNKNOWN  # what they accepted since is not known
    for _ in range(2):
        action.take_all(AllSaid(3, ()), 1.5)
    assert exit_of(action) is Exit.OK
    assert "RUNNING" not in table([action])[-1]


def test_what_one_of_two_servers_has_ended_may_run_on_the_other() -> None:
    action = stopping()
    action.seen(["/server", "/second"])
    assert action.to_ask(0.0) == 1
    for _ in range(2):
        action.take_all(AllSaid(1, (ONE,)), 0.1)
    action.has_looked(0.1)
    action.take_news([GoalSeen(ONE, "CANCELED", 10)], 0.0)
    assert action.settle(2.0, over=False) == []  # the other one has consented, too
    action.take_news([GoalSeen(ONE, "CANCELING", 11)], 0.0)
    assert action.settle(3.0, over=False) == []
    assert [fate.cancel for fate in action.settle(4.0, over=True)] == ["UNKNOWN"]
    assert exit_of(action) is Exit.CANCEL_UNKNOWN


def test_what_both_of_two_servers_have_ended_has_stopped() -> None:
    action = Cancelling("/a", [ONE])
    action.seen(["/server", "/second"])
    action.has_looked(0.0)
    action.take_news([GoalSeen(ONE, "EXECUTING", 10)], 0.0)
    assert action.to_ask_singly(0.1) == [ONE]
    action.take_news([GoalSeen(ONE, "CANCELED", 10)], 0.0)
    assert action.settle(0.2, over=False) == []  # the other one's status may come yet
    action.take_news([GoalSeen(ONE, "CANCELED", 11)], 0.0)
    assert [fate.cancel for fate in action.settle(1.2, over=False)] == ["CONFIRMED"]


def test_what_one_of_two_servers_does_not_show_is_not_known_to_have_stopped() -> None:
    action = Cancelling("/a", [ONE])
    action.seen(["/server", "/second"])
    action.has_looked(0.0)
    action.take_news([GoalSeen(ONE, "EXECUTING", 10)], 0.0)
    action.to_ask_singly(0.1)
    for _ in range(2):
        action.take(CancelSaid(ONE, CancelAnswer.ACCEPTED), 0.2)
    action.take_news([GoalSeen(ONE, "CANCELED", 10)], 0.0)
    assert action.settle(2.0, over=False) == []
    assert [fate.cancel for fate in action.settle(4.0, over=True)] == ["UNKNOWN"]


def test_an_error_is_no_consent() -> None:
    """rclc, the client library of micro-ROS, answers so to each request to cancel all."""
    action = stopping()
    assert action.to_ask(0.0) == 1
    action.take_all(AllSaid(1, (), code=2), 0.1)
    assert action.done  # asking again would tell nothing new
    assert exit_of(action) is Exit.CANCEL_UNKNOWN
    assert table([action])[-1] == (
        "/a: 1 of 1 servers cannot, or will not, cancel all goals (return code 2, of /server):"
        " cancel each by its id."
        " GOALS MAY STILL BE RUNNING."
    )
    action.once_more()
    assert action.to_ask(4.0) == 2
    action.take_all(AllSaid(2, ()), 4.1)
    assert exit_of(action) is Exit.OK


def test_the_error_of_a_server_that_refuses_is_told_once() -> None:
    """Those in C++ answer so if they refuse to cancel each goal."""
    action = stopping("EXECUTING")
    action.to_ask(0.0)
    action.take_all(AllSaid(1, (), code=1), 0.1)
    action.to_ask_singly(0.6)
    action.take(CancelSaid(ONE, CancelAnswer.REFUSED), 0.7)
    action.settle(2.0, over=False)
    assert (action.unheard, exit_of(action)) == ("", Exit.CANCEL_REFUSED)


def test_a_server_that_comes_later_is_asked() -> None:
    action = stopping()
    assert action.to_ask(0.0) == 1
    action.take_all(AllSaid(1, ()), 0.1)
    action.seen(["/server", "/third"])
    assert action.to_ask(0.6) == 2
    assert action.servers == ("/server", "/third")


def test_two_servers_of_one_node_are_asked_once() -> None:
    action = Cancelling("/a")
    for now in (0.0, 0.1):
        action.seen(["/server", "/server"])
        action.take_news(("/server", "/server"), 0.0)
        assert action.to_ask(now) == (None if now else 1)
    for _ in range(2):
        assert not action.done
        action.take_all(AllSaid(1, ()), 0.2)
    assert action.done


@pytest.mark.parametrize(
    ("state", "why"), [("EXECUTING", "No request"), ("CANCELING", "The server is cancelling it")]
)
def test_a_goal_that_was_not_asked_for_in_time_may_run(state: str, why: str) -> None:
    action = stopping(state)
    action.settle(0.0, over=True)
    (fate,) = action.fates
    assert fate.cancel == "UNKNOWN"
    assert fate.text.startswith(why)
    assert fate.text.endswith("MAY STILL BE RUNNING.")


def test_it_is_known_whether_goals_are_still_being_sent() -> None:
    action = stopping("EXECUTING")
    action.to_ask(0.0)
    assert not action.gets_more(0.5), "all were there before"
    goal_is(action, "EXECUTING", TWO)
    action.to_ask(3.0)
    assert action.gets_more(3.9)
    assert not action.gets_more(4.1)


def test_a_goal_that_its_server_has_forgotten_may_still_be_running() -> None:
    action = stopping("EXECUTING")
    action.to_ask(0.0)
    action.take_all(AllSaid(1, (ONE,)), 0.1)
    assert action.to_ask_singly(0.7) == [ONE]
    action.take(CancelSaid(ONE, CancelAnswer.UNKNOWN_GOAL), 0.8)
    action.settle(5.0, over=False)
    assert not action.done
    action.settle(5.0, over=True)
    assert [(fate.cancel, "MAY STILL" in fate.text) for fate in action.fates] == [("UNKNOWN", True)]
    assert exit_of(action) is Exit.CANCEL_UNKNOWN


def test_a_goal_that_was_seen_too_late_for_a_request_is_told_of() -> None:
    action = stopping("EXECUTING")
    action.settle(0.0, over=True)
    assert [fate.cancel for fate in action.fates] == ["UNKNOWN"]


def test_more_goals_than_a_watch_keeps_have_all_a_known_end() -> None:
    action = Cancelling("/a")
    action.take_news(("/server",), 0.0)
    ids = [f"00000000-0000-0000-0000-{number:012}" for number in range(1500)]
    action.take_news([GoalSeen(goal_id, "EXECUTING", 0) for goal_id in ids], 0.0)
    action.to_ask(0.0)
    action.take_all(AllSaid(1, tuple(ids)), 0.1)
    action.take_news([GoalSeen(goal_id, "CANCELED", 0) for goal_id in ids], 0.2)
    action.settle(0.2, over=False)
    assert action.done
    assert [fate.cancel for fate in action.fates] == ["CONFIRMED"] * 1500


class Graph:
    """One server, and all that `cancel_goals` needs to ask it."""

    place = None

    def __init__(self, monkeypatch: pytest.MonkeyPatch, *, others_send: bool) -> None:
        self.asks: list[int] = []
        """The numbers of the requests to cancel all."""
        self._others_send = others_send
        monkeypatch.setattr("actionkit._ros.others_goals.watch.StatusReader", self._read)
        monkeypatch.setattr("actionkit._ros.cancelling.cancel.GoalCanceller", self._canceller)
        monkeypatch.setattr("actionkit._ros.cancelling.cancel_goals._ANSWER", 0.0)

    def actions(self) -> dict[str, Any]:
        servers = [SimpleNamespace(node="/server")]
        return {"/a": SimpleNamespace(name="/a", servers=servers)}

    def names(self, name: str) -> Any:
        return None

    def may_hide_goals(self, name: str) -> bool:
        return False

    def _read(self, *_: object, on_goals: Any, on_servers: Any, **__: object) -> Any:
        self._tell = on_goals
        on_servers(("/server",))
        return SimpleNamespace(close=lambda: None)

    def _canceller(self, names: Any, put: Any, place: Any) -> Any:
        def cancel_all(number: int, until: float) -> None:
            assert number < 200, "it goes on for ever"
            self.asks.append(number)
            put(AllSaid(number, ()))
            if self._others_send:
                self._tell([GoalSeen(f"{ONE[:-3]}{number:03}", "EXECUTING", 0)])

        nothing = lambda *_: None  # noqa: E731
        return SimpleNamespace(cancel_all=cancel_all, cancel=nothing, stop=nothing, close=nothing)

    def stop(self, over: Callable[[float], bool]) -> list[Cancelling]:
        actions: list[Cancelling] = []
        look = 0.0 if self._others_send else 0.05  # else a fast computer gets far in that time
        cancel_goals(cast(Any, self), actions, over=over, look=look)
        return actions


def test_a_stop_keeps_its_time_while_others_send_goals(monkeypatch: pytest.MonkeyPatch) -> None:
    graph = Graph(monkeypatch, others_send=True)
    (action,) = graph.stop(lambda _: len(graph.asks) > 20)
    action.settle(9.0, over=True)
    assert exit_of(action) is Exit.CANCEL_UNKNOWN


def test_goals_accepted_while_servers_are_looked_for_are_canceled(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    graph = Graph(monkeypatch, others_send=False)
    (action,) = graph.stop(lambda _: False)
    assert graph.asks == [1, 2]  # at once, and when no other server can be seen any more
    assert exit_of(action) is Exit.OK


def test_the_exit_code_is_that_of_the_worst() -> None:
    assert worst([Exit.OK, Exit.FAILED, Exit.CANCEL_UNKNOWN]) is Exit.CANCEL_UNKNOWN
    assert worst([Exit.CANCEL_UNKNOWN, Exit.CANCEL_REFUSED]) is Exit.CANCEL_REFUSED
    assert worst([Exit.NO_SERVER, Exit.FAILED]) is Exit.FAILED
    assert worst([]) is Exit.OK


class Telling:
    """Replaces the view of holds: what it knows at each look."""

    def __init__(self, *looks: tuple[tuple[Hold, ...], str]) -> None:
        self.looks = list(looks)
        self.released: list[Hold] = []
        self.others: list[Any] = []
        self.state = HoldState()
        self.unwritten = ""

    def close(self) -> None:
        pass

    def in_files(self, holds: Any) -> bool:
        return False

    def known(self) -> tuple[HoldState, str]:
        last = len(self.looks) == 1
        holds, unknown = self.looks[0] if last else self.looks.pop(0)
        left = {hold.hold_id: hold for hold in holds if hold not in self.released}
        self.state = HoldState(left)
        late = Sender("agent", "agent", "bob@arm", 1)
        self.others = [] if last else [Said(late, HoldState({"a": OLD}), 0.0)]
        return self.state, unknown

    def release(self, holds: tuple[Hold, ...]) -> None:
        self.released += holds


OLD, NEW = Hold(1.0, "a", "ann@desk"), Hold(2.0, "b", "bob@arm")


def test_the_keeper_stays_until_its_hold_is_released(monkeypatch: pytest.MonkeyPatch) -> None:
    view: Any = SimpleNamespace(has_told=True, others=(), start=list, close=list)
    view.add = partial(setattr, view, "state")
    looks: list[float] = []

    def wait(changed: object, seconds: float) -> None:
        looks.append(seconds)
        if len(looks) == 3:
            view.state = HoldState()

    monkeypatch.setattr("actionkit._ros.holds.view.HoldView", lambda *_, **__: view)
    monkeypatch.setattr("sys.stdin", StringIO(encode(HoldState({"a": OLD}))))
    for name, instead in (("_wait", wait), ("_let_go", list), ("_LEAST", 0.0), ("_MOST", 0.0)):
        monkeypatch.setattr(_keeper, name, instead)
    monkeypatch.setattr("signal.signal", lambda *_: None)
    _keeper.main()
    assert len(looks) == 3


def test_a_stop_holds_agents_itself_also_where_no_process_can_keep_its_hold(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    view: Any = Telling(((), ""))
    view.add, view.start = partial(setattr, view, "state"), list
    view.in_files = lambda holds: True
    keeper = SimpleNamespace(is_ready=lambda: False, pid=None)
    monkeypatch.setattr("actionkit._ros.holds.view.HoldView", lambda *_, **__: view)
    monkeypatch.setattr("actionkit.cli.cancel_and_stop._holding.Keeper", lambda hold: keeper)
    survey = SimpleNamespace(domain_id=7)
    monkeypatch.setattr(stop, "open_survey", lambda: nullcontext(survey))
    monkeypatch.setattr(stop, "cancel_goals", lambda *_, **__: None)
    monkeypatch.setattr(stop, "_GRACE", 0.0)
    assert stop._stop_all(0.0, as_json=False) == Exit.FAILED
    assert len(view.state.active) == 1
    said = capsys.readouterr()
    assert "Agents are held until `actionkit stop --release`" in said.out
    assert "The process that keeps the hold has not come up" in said.err


def test_a_release_does_not_end_a_stop_that_comes_after_it(
    capsys: pytest.CaptureFixture[str],
) -> None:
    view: Any = Telling(((OLD,), "not all heard"), ((OLD,), ""), ((NEW,), ""))
    assert release(view, LONG, as_json=False) is Exit.HELD
    assert view.released == [OLD]
    said = capsys.readouterr()
    assert "ann@desk" in said.out
    assert "bob@arm has stopped the robot meanwhile" in said.err
    view = Telling(((OLD,), ""), ((NEW,), ""))
    assert release(view, LONG, as_json=True) is Exit.HELD
    assert json.loads(capsys.readouterr().out.splitlines()[0])["held"] is True


def test_an_agent_that_has_not_confirmed_the_hold_is_told_of() -> None:
    def said(role: str, number: int, *holds: Hold) -> Said:
        state = HoldState({hold.hold_id: hold for hold in holds})
        return Said(Sender(f"{role}_{number}", role, "bob@arm", number), state, 0.0)

    others = [said("agent", 1, OLD), said("agent", 2), said("agent", 3, NEW), said("keeper", 4)]
    view: Any = SimpleNamespace(state=HoldState({"a": OLD}), others=others)
    knowing, late = agents_told(view)
    assert knowing == ["agent of bob@arm (process 1)"]
    assert late == ["agent of bob@arm (process 2)", "agent of bob@arm (process 3)"]

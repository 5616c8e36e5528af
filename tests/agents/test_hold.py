"""Listeners to holds, over real DDS. Contract C10.4."""

from __future__ import annotations

import os
import signal
import threading
import time
import uuid
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

from actionkit._ros.holds import view as views
from actionkit._ros.holds.ours import new_hold
from actionkit._ros.holds.state import Hold, HoldState
from actionkit._ros.holds.topic import TOPIC, HoldTopic
from actionkit._ros.holds.view import HoldView
from actionkit._ros.rclpy_private.native import shut_down
from actionkit.agents._tool_calls import goal_call
from actionkit.agents._tool_calls.hold import HoldListener
from actionkit.testing import isolated_domain
from tests.conftest import Script, all_is_logged
from tests.holding import AGENT, known
from tests.waiting import until

LONG = 30.0
RunScript = Callable[..., Script]
SILENT = """
import sys, threading
from actionkit._ros.holds.view import HoldView
HoldView._tell = lambda self: None
joined = threading.Event()
view = HoldView(None, "agent", speaks=True, on_change=joined.set)
view.start()
assert joined.wait(30)
print("ready", flush=True)
sys.stdin.read()
view.close()
"""


@pytest.fixture
def apart(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[], None]:
    """Have what starts from now on use files of its own, as on another computer."""
    numbers = iter(range(100))

    def move() -> None:
        monkeypatch.setenv("ACTIONKIT_HOLD_DIR", str(tmp_path / f"computer-{next(numbers)}"))

    move()
    return move


@contextmanager
def listening(
    domain: int | None = None, on_hold: Callable[[str], object] = lambda _: None
) -> Iterator[HoldListener]:
    listener = HoldListener(domain, on_hold)
    try:
        yield listener
    finally:
        listener.close()


@contextmanager
def telling(*holds: Hold) -> Iterator[HoldView]:
    """Yield what a keeper has."""
    view = HoldView(None, "keeper", speaks=True)
    view.add(HoldState({hold.hold_id: hold for hold in holds}))
    view.start()
    try:
        yield view
    finally:
        view.close()


def test_free_only_when_that_is_known(
    ros_domain: int, apart: Callable[[], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    began = time.monotonic()
    with listening() as listener:
        assert "not known yet" in (listener.why_held() or "")
        assert not listener.is_known
        assert not known(listener, 0.1)
        assert known(listener, LONG)
        assert time.monotonic() - began >= views.SETTLE
        assert listener.why_held() is None
        assert known(listener, 0)
        # The process, or the whole computer, was away for a while: the first question comes before
        # its thread has noticed.
        uptime = views._uptime
        monkeypatch.setattr(views, "_uptime", lambda: uptime() + 60.0)
        assert "not known yet" in (listener.why_held() or "")
    assert "is closed" in (listener.why_held() or "")
    listener.close()


def test_held_by_the_topic_released_by_another_and_kept_by_who_knows(
    ros_domain: int, apart: Callable[[], None], run_script: RunScript
) -> None:
    hold = Hold(1.0, "one", "ann@laptop")  # whose clock is decades off
    told: list[str] = []
    with listening(on_hold=told.append) as agent:
        assert known(agent, LONG)
        assert agent.why_held() is None
        apart()
        with telling(hold) as keeper:
            until(lambda: told)
            assert told == [agent.why_held()]
            assert told[0].startswith("A human has stopped the robot: ann@laptop since ")
            until(lambda: any("one" in said.state.holds for said in keeper.others))
        # Its keeper is gone, and the listener goes on telling those that start now.
        later = run_script(AGENT)
        assert later.line() == "known True"
        assert later.process.stdin is not None
        print("now", file=later.process.stdin, flush=True)
        assert "ann@laptop" in later.line()

        apart()
        with telling() as releaser:
            until(lambda: releaser.state.active)
            until(lambda: len(releaser.others) == 2)
            releaser.release(releaser.state.active)
            until(lambda: agent.why_held() is None)
            until(lambda: not any(said.state.active for said in releaser.others))
        # Whoever comes into sight may have something to tell, so it is known only after a moment.
        print("known\nnow", file=later.process.stdin, flush=True)
        assert [later.line(), later.line()] == ["True", "FREE"]
        assert later.finish()[0] == 0
        # Held and released again and again, nothing piles up.
        with telling() as keeper:
            for _ in range(120):
                keeper.add(HoldState({(hold := new_hold()).hold_id: hold}))
                keeper.release((hold,))
            last = new_hold()
            keeper.add(HoldState({last.hold_id: last}))
            until(lambda: agent.why_held() is not None)
            keeper.release((last,))
            until(lambda: agent.why_held() is None)
            until(lambda: keeper.others)
            until(lambda: all(len(said.state.released) == 100 for said in keeper.others))


def test_a_process_that_was_stopped_learns_what_it_missed(
    ros_domain: int, apart: Callable[[], None], run_script: RunScript
) -> None:
    agent = run_script(AGENT)
    assert agent.line() == "known True"

    def asked(word: str) -> str:
        assert agent.process.stdin is not None
        print(word, file=agent.process.stdin, flush=True)
        return agent.line()

    assert asked("now") == "FREE"
    apart()
    with telling() as human:
        until(lambda: human.others)
        os.kill(agent.process.pid, signal.SIGSTOP)
        os.waitid(os.P_PID, agent.process.pid, os.WSTOPPED | os.WNOWAIT)
        hold = new_hold()
        human.add(HoldState({hold.hold_id: hold}))
        threading.Event().wait(views._GAP + 0.5)  # what it takes to be noticed as an absence
        os.kill(agent.process.pid, signal.SIGCONT)
        assert asked("now") != "FREE"
        assert asked("known") == "True"
        assert "A human has stopped" in asked("now")

        os.kill(agent.process.pid, signal.SIGSTOP)
        os.waitid(os.P_PID, agent.process.pid, os.WSTOPPED | os.WNOWAIT)
        human.release((hold,))
        os.kill(agent.process.pid, signal.SIGCONT)
        until(lambda: not any(said.state.active for said in human.others))
        until(lambda: asked("now") == "FREE")
    assert agent.finish()[0] == 0


def is_replaced_by_a_file(directory: Path) -> bool:
    """Whether a file took the place of a directory, before the listener made it again."""
    directory.rename(directory.with_name(f"away-{uuid.uuid4()}"))
    try:
        directory.touch(exist_ok=False)
    except FileExistsError:
        return False
    return True


@pytest.mark.long
def test_a_file_is_obeyed_before_anybody_is_discovered(
    ros_domain: int, apart: Callable[[], None]
) -> None:
    with listening() as agent:
        assert known(agent, LONG)
        hold = new_hold()
        files = views.HoldFiles(ros_domain)
        files.write(HoldState({hold.hold_id: hold}))
        assert "A human has stopped" in (agent.why_held() or "")
        files.write(HoldState({}, {hold.hold_id: 1}))
        assert agent.why_held() is None
        # Its own errors count as not knowing.
        directory = Path(files.directory)
        until(lambda: is_replaced_by_a_file(directory))
        assert "not known" in (agent.why_held() or "")
        directory.unlink()
        assert agent.why_held() is None
    # A hold that only a file tells of any more: the agent and its keeper have crashed.
    files.write(HoldState({(other := new_hold()).hold_id: other}))
    with listening() as agent:
        assert "A human has stopped" in (agent.why_held() or "")
        assert known(agent, 0)


@pytest.mark.long
def test_a_disk_that_hangs_lets_no_goal_through(
    ros_domain: int, apart: Callable[[], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    told = threading.Event()
    with listening(on_hold=lambda _: told.set()) as agent, ExitStack() as stack:
        assert known(agent, LONG)
        apart()
        keeper = stack.enter_context(telling())
        until(lambda: keeper.others)
        hanging, go_on = threading.Event(), threading.Event()
        stack.callback(go_on.set)

        def write(_: object, state: HoldState) -> None:
            if state:  # before the hold comes, everybody writes that there is none
                hanging.set()
                go_on.wait(LONG)

        monkeypatch.setattr(views.HoldFiles, "write", write)
        keeper.add(HoldState({(hold := new_hold()).hold_id: hold}))
        assert told.wait(LONG)
        assert "A human has stopped" in (agent.why_held() or "")
        assert hanging.wait(LONG)


@pytest.mark.long
def test_garbage_on_the_topic_holds(ros_domain: int, apart: Callable[[], None]) -> None:
    from rcl_interfaces.msg import Log

    with listening() as agent:
        assert known(agent, LONG)
        with telling() as human:
            until(lambda: human.has_told)
            topic = human._topic
            assert topic is not None
            topic._runtime.run(lambda: topic._publisher.publish(Log(msg="STOP")))
            until(lambda: agent.why_held() is not None, TOPIC)
            assert "somebody whose message cannot be read" in (agent.why_held() or "")
            until(lambda: human.state.active)
            human.release(human.state.active)
            until(lambda: agent.why_held() is None)


@pytest.mark.long
def test_whoever_is_in_sight_and_silent_makes_it_unknown(
    ros_domain: int, apart: Callable[[], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(views, "SETTLE", 0.0)
    with telling() as human:
        monkeypatch.setattr(HoldView, "_tell", lambda self: None)
        until(lambda: human._topic is not None)
        with listening() as agent:
            until(lambda: agent._view._speakers)
            assert not known(agent, 1.5)
            assert "not all been heard" in (agent.why_held() or "")
            # One on the same computer has a file, too. (Two users' agents never hear each other.)
            monkeypatch.setattr(views, "_FILES_DO", 2.0)
            assert known(agent, LONG)


@pytest.mark.long
def test_who_is_not_heard_and_has_other_files_makes_it_unknown(
    ros_domain: int,
    apart: Callable[[], None],
    run_script: RunScript,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Agents in two containers, each with a /tmp of its own."""
    monkeypatch.setattr(views, "SETTLE", 0.0)
    monkeypatch.setattr(views, "_FILES_DO", 2.0)
    silent = run_script(SILENT)
    assert silent.line() == "ready"
    with listening() as beside:
        until(lambda: len(beside._view._speakers) == 2)
        assert not beside.is_known
        assert known(beside, LONG)
    apart()
    with listening() as contained:
        until(lambda: len(contained._view._speakers) == 2)
        assert not known(contained, 2 * views._FILES_DO)
        assert "give both the same folder" in (contained.why_held() or "")
    assert silent.finish()[0] == 0


@pytest.mark.long
def test_a_middleware_that_cannot_be_joined_makes_it_unknown(
    apart: Callable[[], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise RuntimeError("no middleware")

    monkeypatch.setattr(views, "HoldTopic", refuse)
    with isolated_domain() as domain, listening(domain) as agent:
        assert not known(agent, 0.2)
        until(lambda: "no middleware" in (agent.why_held() or ""))
        monkeypatch.undo()
        assert known(agent, LONG)


def test_a_callback_that_raises_is_told_of_and_harms_nobody(
    ros_domain: int, apart: Callable[[], None]
) -> None:
    told: list[str] = []

    def broken(sentence: str) -> None:
        told.append(sentence)
        raise ValueError("mine")

    with listening(on_hold=broken) as agent:
        hold = new_hold()
        views.HoldFiles(ros_domain).write(HoldState({hold.hold_id: hold}))
        until(lambda: told)
        assert agent.why_held() == told[0]
        assert known(agent, LONG)


def test_after_an_error_of_the_listener_it_is_not_known(monkeypatch: pytest.MonkeyPatch) -> None:
    class Broken:
        def __init__(self, *_: object, **__: object) -> None:
            pass

        def start(self) -> None:
            pass

        def close(self) -> None:
            pass

        def known(self) -> None:
            raise RuntimeError("for the test")

    monkeypatch.setattr(views, "HoldView", Broken)
    with listening() as listener:
        assert not listener.is_known
        assert "nothing is sent to it (RuntimeError: for the test)" in (listener.why_held() or "")


def test_a_call_waits_for_what_a_killed_agent_cannot_tell() -> None:
    assert max(views._FILES_DO, views.SETTLE) + 2.0 < goal_call._UNTIL_KNOWN


def test_what_is_said_after_a_shutdown_is_dropped(
    ros_domain: int, caplog: pytest.LogCaptureFixture
) -> None:
    """As at the end of a program, whose contexts rclpy shuts down at any moment."""
    topic = HoldTopic(ros_domain, lambda _: None, speaks=True, files="none")
    shut_down(topic._runtime.context)
    topic.say("too late")
    topic.close()
    all_is_logged()
    assert not caplog.records

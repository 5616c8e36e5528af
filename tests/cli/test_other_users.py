"""`actionkit stop`, if the agent, the servers and the human are different users. Contract C10.4.

Fast DDS talks by shared memory between processes of one computer, which those of another user
cannot open.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from test_msgs.action import Fibonacci

from actionkit import Client, GoalState
from actionkit.agents._tool_calls.hold import HoldListener
from actionkit.cli._shared.exits import Exit
from tests.cli.conftest import Running, World
from tests.holding import AGENT, end_keepers, keepers, known
from tests.waiting import until

LONG = 30.0
OTHER = 54321
CAN = os.getuid() == 0 and shutil.which("setpriv") is not None
pytestmark = [
    pytest.mark.skipif(not CAN, reason="needs root and setpriv, to become another user"),
]


@dataclass
class OtherUser:
    """Another user of this computer, in the same ROS domain; the folder of holds is for both."""

    words: list[str]
    environment: dict[str, str]

    def run(self, *words: str) -> tuple[int, str]:
        """Run the command line to its end."""
        done = subprocess.run(
            [*self.words, "-m", "actionkit", *words],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            env=self.environment,
            timeout=60,
            check=False,
        )
        return done.returncode, done.stdout


@pytest.fixture
def other_user(empty_world: World, monkeypatch: pytest.MonkeyPatch) -> Iterator[OtherUser]:
    directory = Path("/tmp") / f"actionkit-test-{os.getpid()}-{empty_world.domain}"
    directory.mkdir()
    os.chown(directory, OTHER, OTHER)
    # Where Python lies may be closed to others; writing anything of ours stays so.
    become = ["setpriv", "--reuid", str(OTHER), "--regid", str(OTHER), "--clear-groups"]
    become += ["--inh-caps", "+dac_read_search", "--ambient-caps", "+dac_read_search"]

    holds = directory / "holds"
    holds.mkdir()
    holds.chmod(0o1777)  # as /tmp/actionkit-holds
    monkeypatch.setenv("ACTIONKIT_HOLD_DIR", str(holds))
    variables = ("ROS_LOG_DIR", "HOME")
    environment = {
        **empty_world.environment,
        **dict.fromkeys(variables, str(directory)),
        **dict.fromkeys(("USER", "LOGNAME"), "ann"),
    }
    yield OtherUser([*become, sys.executable], environment)
    end_keepers(empty_world.domain)
    shutil.rmtree(directory)


def test_the_stop_of_another_user_stops_and_holds(
    empty_world: World,
    other_user: OtherUser,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    world = empty_world
    monkeypatch.setenv("ROS_DOMAIN_ID", str(world.domain))
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    server = world.server("never_finishes")
    agent = HoldListener()
    try:
        with Client(Fibonacci, "never_finishes", on_close="abandon") as client:
            assert client.wait_for_server(LONG)
            future = client.call_async(Fibonacci.Goal(order=900))
            server.wait_for("executing")
            assert known(agent, LONG)
            assert agent.why_held() is None

            # Two agents of two users never hear each other, and yet neither waits for ever.
            theirs = Running(
                subprocess.Popen(
                    [*other_user.words, "-c", AGENT],
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    stderr=subprocess.STDOUT,
                    text=True,
                    env=other_user.environment,
                )
            )
            world.stack.callback(theirs.process.kill)
            theirs.until("known True")
            assert known(agent, LONG)

            code, text = other_user.run("stop")
            assert code == Exit.OK, text
            assert "2 in sight obey" in text
            assert theirs.process.stdin is not None
            print("now", file=theirs.process.stdin, flush=True)
            theirs.until("A human has stopped the robot: ann@")
            theirs.process.stdin.close()
            theirs.process.stdin = None
            theirs.finish()
            assert theirs.process.stdout is not None
            theirs.process.stdout.close()
            assert future.outcome(LONG).status is GoalState.CANCELED
            assert "ann@" in (agent.why_held() or "")

            (keeper,) = keepers(world.domain)
            assert os.stat(f"/proc/{keeper}").st_uid == OTHER
            released = world.run_apart("stop", "--release")
            assert released.code == Exit.OK
            assert "Released: the hold of ann@" in released.out
            assert agent.why_held() is None
            until(lambda: not keepers(world.domain))
    finally:
        agent.close()

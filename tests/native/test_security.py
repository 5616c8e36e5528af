"""Secured graphs (SROS 2), with CycloneDDS: `pytest --combination python-cyclonedds`."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from tests.docs.snippets import ROOT, blocks
from tests.native.build import SOURCES
from tests.native.promises import CYCLONE

pytestmark = pytest.mark.skipif(
    CYCLONE not in os.environ.get("RMW_IMPLEMENTATION", ""),
    reason="needs a middleware with security: pytest --combination python-cyclonedds",
)
ACTION = "fibonacci/_action"
SERVICES = ("send_goal", "get_result", "cancel_goal")
ALLOWED = (
    *("ros_discovery_info", "rt/parameter_events", f"rt/{ACTION}/feedback", f"rt/{ACTION}/status"),
    *(f"rq/{ACTION}/{name}Request" for name in SERVICES),
    *(f"rr/{ACTION}/{name}Reply" for name in SERVICES),
)
"""What `ros2 security` makes of the policy in the guide, for the middleware."""
CALLS = """
import sys
from actionkit import ActionKitError, Client
from test_msgs.action import Fibonacci

node = None
if sys.argv[1:2] == ["in a context"]:
    import rclpy
    rclpy.init(args=["--ros-args", "--enclave", "/robot/free"])
    node = rclpy.create_node("mission")
try:
    with Client(Fibonacci, "fibonacci", node=node) as client:
        seen = []
        print(list(client.call({"order": 3}, timeout=30, on_feedback=seen.append).sequence))
        print(client.cancel_everything())
except ActionKitError as error:
    print(type(error).__name__, error)
"""


def without_preload() -> dict[str, str]:
    """Return the environment without CycloneDDS, which `--combination` has every program load.

    It makes threads, and a shell forks: then its child may wait for ever for one of them.
    """
    return {name: value for name, value in os.environ.items() if name != "LD_PRELOAD"}


@pytest.fixture(scope="session")
def keystore(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("security") / "keys"
    allowed = f"/robot/client={','.join(ALLOWED)}"
    enclaves = ["/robot/server", "/robot/free", "/robot/chatter=rt/chatter", allowed]
    script = str(SOURCES / "make_keystore.py")
    subprocess.run([sys.executable, script, folder, *enclaves], check=True, env=without_preload())
    return folder


@pytest.fixture
def server(keystore: Path, action_server: Any, monkeypatch: pytest.MonkeyPatch) -> Any:
    """A server in an enclave of its own. Security stays on for what the test starts."""
    monkeypatch.setenv("ROS_SECURITY_ENABLE", "true")
    monkeypatch.setenv("ROS_SECURITY_STRATEGY", "Enforce")
    monkeypatch.setenv("ROS_SECURITY_KEYSTORE", str(keystore))
    with monkeypatch.context() as patch:
        patch.setenv("ROS_SECURITY_ENCLAVE_OVERRIDE", "/robot/server")
        return action_server("fibonacci")


@pytest.mark.parametrize(
    ("variable", "arguments"),
    [
        ("/robot/client", []),
        (None, ["--ros-args", "--enclave", "/robot/client"]),
        (None, ["in a context"]),
    ],
    ids=["environment", "command line", "context"],
)
@pytest.mark.every
def test_a_client_uses_its_enclave(
    variable: str | None,
    arguments: list[str],
    server: Any,
    run_script: Any,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    if variable is not None:
        monkeypatch.setenv("ROS_SECURITY_ENCLAVE_OVERRIDE", variable)
    code, out, err = run_script(CALLS, *arguments).finish()
    assert (code, out) == (0, "[0, 1, 1, 2]\n{}\n"), err
    assert server.count("succeeded") == 1


def test_what_the_policy_does_not_allow_is_told(
    server: Any, run_script: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROS_SECURITY_ENCLAVE_OVERRIDE", "/robot/chatter")
    code, out, _ = run_script(CALLS).finish()
    assert code == 0
    assert out.startswith("SecurityError ROS security keeps this process out: "), out
    assert server.count("goal_received") == 0


def test_a_server_without_keys_is_not_seen_and_that_is_told(
    action_server: Any, server: Any, run_script: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROS_SECURITY_ENCLAVE_OVERRIDE", "/robot/free")
    source = CALLS.replace('"fibonacci", node', '"open", node').replace("timeout=30", "timeout=2")
    with monkeypatch.context() as patch:
        patch.setenv("ROS_SECURITY_ENABLE", "false")
        action_server("fibonacci", action_name="open")
    code, out, _ = run_script(source).finish()
    assert code == 0
    assert out.startswith("ServerUnavailableError No server for action '/open'"), out
    assert "ROS security is on, as enclave '/robot/free'" in out


def test_the_commands_of_the_guide(server: Any, keystore: Path, tmp_path: Path) -> None:
    page = ROOT / "docs" / "guides" / "security.md"
    (block,) = [block for block in blocks(page) if "actionkit call" in block.text]
    commands = block.text.replace("/opt/robot/keys", str(keystore))
    done = subprocess.run(
        ["bash", "-ec", f"export LD_PRELOAD='{os.environ.get('LD_PRELOAD', '')}'\n{commands}"],
        env={**without_preload(), "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done
    assert "security is on, as enclave '/robot/client'" in " ".join(done.stdout.split())
    assert server.count("succeeded") == 1

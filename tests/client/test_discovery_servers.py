"""Two robots with one name and domain, each with its own discovery server (C1.2)."""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import sys
import sysconfig
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from tests.client.test_action_names import SERVERS

BINARY = shutil.which(
    "fast-discovery-server", path=os.pathsep.join([str(Path(sys.executable).parent), os.defpath])
)
LIBRARIES = (
    Path(sys.prefix, "lib"),
    Path(sysconfig.get_path("purelib"), "ros_rmw_fastrtps_cpp.libs"),
)


@pytest.fixture
def addresses() -> Iterator[list[str]]:
    """Start two, and return their addresses."""
    assert BINARY is not None
    with ExitStack() as stack:
        found = []
        for _ in range(2):
            with socket.socket(type=socket.SOCK_DGRAM) as free:
                free.bind(("127.0.0.1", 0))
                port = free.getsockname()[1]
            process = stack.enter_context(
                # The first of a list of servers has the number 0.
                subprocess.Popen(
                    [BINARY, "-i", "0", "-l", "127.0.0.1", "-p", str(port)],
                    stdout=subprocess.PIPE,
                    env=os.environ | {"LD_LIBRARY_PATH": os.pathsep.join(map(str, LIBRARIES))},
                )
            )
            stack.callback(process.kill)
            assert process.stdout is not None
            while b"running" not in process.stdout.readline():
                assert process.poll() is None
            found.append(f"127.0.0.1:{port}")
        yield found


PROGRAM = """
import os, sys
from rclpy.context import Context
from rclpy.node import Node
from actionkit import Client
from test_msgs.action import Fibonacci
clients = []
for address in sys.argv[1:]:
    os.environ["ROS_DISCOVERY_SERVER"] = address
    context = Context()
    context.init([])
    clients.append(Client(Fibonacci, "arm", node=Node("users", context=context)))
for _ in range(3):
    print([client.call({}, 20).sequence[0] for client in clients])
"""
"""In a process of its own: after it Fast DDS discovers nobody without a discovery server."""


@pytest.mark.skipif(BINARY is None, reason="needs fast-discovery-server")
@pytest.mark.long
def test_each_robot_gets_its_own_goal(addresses, run_script, ros_domain, monkeypatch):
    for number, address in enumerate(addresses):
        monkeypatch.setenv("ROS_DISCOVERY_SERVER", address)
        # Robot number 1 has that number in its answer: as its second action.
        names = ["/other", "/arm"][1 - number :]
        assert run_script(SERVERS, str(ros_domain), *names).line() == ""
    monkeypatch.delenv("ROS_DISCOVERY_SERVER")
    code, out, err = run_script(PROGRAM, *addresses).finish(40)
    assert (code, out) == (0, "[0, 1]\n" * 3), err

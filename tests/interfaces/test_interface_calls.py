"""Built packages in real calls: with servers of the shipped package, of a user, and ours."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from actionkit import servers
from tests import forked
from tests.conftest import Script
from tests.interfaces.conftest import (
    SHIPPED,
    actionkit,
    build_shadowing,
    environment,
    run_python,
    write_package,
)

FIBONACCI = """
import sys, test_msgs
from actionkit import Client
from test_msgs.action import Fibonacci
assert test_msgs.__file__.startswith(sys.argv[1]), test_msgs.__file__
with Client(Fibonacci, "fibonacci") as client:
    print(list(client.call(Fibonacci.Goal(order=5), timeout=30.0).sequence))
loaded = [line.split()[-1] for line in open("/proc/self/maps") if "test_msgs" in line]
assert loaded
assert all(path.startswith(sys.argv[1]) for path in loaded), set(loaded)
"""


def hashes(share: Path) -> dict[str, str]:
    found = {}
    for path in sorted(share.glob("*/*.json")):
        for one in json.loads(path.read_text())["type_hashes"]:
            found[one["type_name"]] = one["hash_string"]
    return found


@pytest.mark.long
@pytest.mark.heavy
def test_type_hashes_are_those_of_colcon(shadowing: Path) -> None:
    shipped = hashes(SHIPPED)
    assert len(shipped) > 50
    assert hashes(shadowing / "share" / "test_msgs") == shipped


@pytest.mark.long
@pytest.mark.heavy
def test_built_client_and_shipped_server(shadowing: Path, ros_domain: int) -> None:
    with servers.start("fibonacci", domain_id=ros_domain):
        env = environment(shadowing, ROS_DOMAIN_ID=str(ros_domain))
        assert run_python(FIBONACCI, shadowing, env=env) == "[0, 1, 1, 2, 3, 5]\n"


# --- odd names, and many of them -------------------------------------------------------------

ODD = """
from actionkit import Client
from geometry_msgs.msg import Point
from odd_actions.action import Odd, Wide
from odd_parts.msg import Holder, Part
from odd_parts.srv import Find

part = Part(name="bolt", holder=Holder(at=Point(x=2.5)))
goal = Odd.Goal(array=1, str="s", order="late", type="t", part=part, parts=[part, Part()])
goal.self = [1, 2]
assert Odd.Goal().order == 'a "quoted" one', Odd.Goal().order
seen = []
with Client(Odd, "odd") as client:
    result = client.call(goal, timeout=30.0, on_feedback=seen.append)
    print(result.msg, result.class_name, [feedback.percent for feedback in seen])
with Client(Wide, "wide") as client:
    goal = Wide.Goal(**{f"field_{n}": n for n in range(200)})
    print(client.call(goal, timeout=30.0).sum)
Find.Response(part=part)
"""


@pytest.fixture
def odd_server(odd: Path, ros_domain: int) -> Iterator[dict[str, str]]:
    env = environment(odd, ROS_DOMAIN_ID=str(ros_domain))
    words = [sys.executable, str(Path(__file__).with_name("odd_server.py"))]
    with forked.Popen(words, env=env, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert Script(process).line() == "ready"
            yield env
        finally:
            process.kill()


@pytest.mark.long
def test_fields_named_as_what_generated_code_uses(odd_server: dict[str, str]) -> None:
    lines = run_python(ODD, env=odd_server).splitlines()
    assert lines == ["(1, 's', [1, 2], 'late', 2.5, 't') 2 [7.0]", str(sum(range(200)))]


@pytest.mark.long
def test_fields_by_name_on_the_command_line(odd_server: dict[str, str]) -> None:
    goal = "{array: 3, str: x, self: [5], order: soon, part: {name: nut}}"
    done = actionkit("call", "odd", "odd_actions/action/Odd", goal, "--json", env=odd_server)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "(3, 'x', [5], 'soon', 0.0, '')" in done.stdout
    shown = actionkit("show", "odd_actions/action/Odd", env=odd_server).stdout
    assert "behind a field" in shown  # the comments are found where they were put


ODD_SERVERS = """
from actionkit import Client, GoalAbortedError, servers
from actionkit.testing import FakeServer
from odd_actions.action import Odd

fields = {"array": 1, "str": "s", "self": [1, 2], "order": "two", "sequence": ["a", "b"]}
said = {"order": "three", "sequence": ["c"], "percent": 2.5}
fake = FakeServer(
    Odd, "fake", feedback=[said], result=lambda goal: {"msg": goal.order, "sequence": goal.sequence}
)
aborting = servers.start("scripted", action_type=Odd, action_name="a", script=["accept", "abort"])
flooding = servers.start("floods", action_type=Odd, action_name="b", steps=3)
with fake, aborting, flooding:
    seen = []
    with Client(Odd, "fake") as client:
        result = client.call(fields, timeout=30.0, on_feedback=seen.append)
    print(result.msg, list(result.sequence), seen == [Odd.Feedback(**said)])
    print([fake.goals[0].array, fake.goals[0].str, list(fake.goals[0].self)])
    with Client(Odd, "a") as client:
        try:
            client.call(fields, timeout=30.0)
        except GoalAbortedError as error:
            print(error.result == Odd.Result())
    with Client(Odd, "b") as client:
        print(client.call(fields, timeout=30.0) == Odd.Result())
"""


@pytest.mark.long
def test_servers_for_tests_of_fields_that_other_types_have_as_numbers(
    odd: Path, ros_domain: int
) -> None:
    lines = run_python(ODD_SERVERS, env=environment(odd, ROS_DOMAIN_ID=str(ros_domain)))
    assert lines.splitlines() == [
        "two ['a', 'b'] True",
        "[1, 's', [1, 2]]",
        "True",
        "True",
    ]


# --- the package of our own ------------------------------------------------------------------

COUNTDOWN = """
from actionkit import Client
from actionkit_interfaces.action import Countdown
seen = []
with Client(Countdown, "count") as client:
    result = client.call(Countdown.Goal(target=3), timeout=30.0, on_feedback=seen.append)
    print(result.completed, result.message, [one.current_count for one in seen])
    future = client.call_async(Countdown.Goal(target=1000), timeout=60.0)
    for _ in future.feedback():
        future.cancel()
    print(future.outcome(30).result.completed)
"""
BESIDE_OURS = """
import actionkit_interfaces.action
from actionkit import Client
from test_msgs.action import Fibonacci
with Client(Fibonacci, "fibonacci") as client:
    print(list(client.call({"order": 3}, timeout=30.0).sequence))
"""
NAVIGATE = """
from actionkit import Client, GoalRejectedError
from actionkit_interfaces.action import NavigateToPose
goal = NavigateToPose.Goal(max_velocity=2.0)
goal.target_pose.header.frame_id = "map"
goal.target_pose.pose.position.x = 0.3
goal.target_pose.pose.position.y = 0.4
seen = []
with Client(NavigateToPose, "navigate") as client:
    result = client.call(goal, timeout=30.0, on_feedback=seen.append)
    print(result.success, result.message, result.total_time.nanosec > 0)
    last = seen[-1]
    print(last.status_message, last.percent_complete, last.distance_remaining)
    print(last.current_pose.header.frame_id, last.current_pose.pose.position.y)
    goal.max_velocity = -1.0
    try:
        client.call(goal, timeout=30.0)
    except GoalRejectedError:
        print("rejected")
"""


@pytest.mark.long
def test_countdown_speaks_its_own_type(
    own: Path, ros_domain: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    env = environment(own, ROS_DOMAIN_ID=str(ros_domain))
    monkeypatch.setenv("PYTHONPATH", str(own))  # of the server
    options = {"action_type": "actionkit_interfaces/action/Countdown", "period": 0.1}
    with servers.start("countdown", action_name="count", domain_id=ros_domain, **options):
        lines = run_python(COUNTDOWN, env=env).splitlines()
    assert lines == ["True counted down from 3 [2, 1, 0]", "False"]


@pytest.mark.long
def test_navigate_speaks_its_own_type(
    own: Path, ros_domain: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    env = environment(own, ROS_DOMAIN_ID=str(ros_domain))
    monkeypatch.setenv("PYTHONPATH", str(own))
    options = {"action_type": "actionkit_interfaces/action/NavigateToPose", "rate": 50.0}
    with servers.start("navigate", action_name="navigate", domain_id=ros_domain, **options):
        lines = run_python(NAVIGATE, env=env).splitlines()
    assert lines == ["True arrived True", "arrived 100.0 0.0", "map 0.4", "rejected"]


@pytest.mark.long
def test_what_is_installed_does_not_change_what_a_server_speaks(
    own: Path, ros_domain: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    env = environment(own, ROS_DOMAIN_ID=str(ros_domain))
    monkeypatch.setenv("PYTHONPATH", str(own))
    with servers.start("countdown", domain_id=ros_domain, period=0.0):
        assert run_python(BESIDE_OURS, env=env).splitlines() == ["[0]"]


def test_a_server_without_the_package_says_how_to_get_it(ros_domain: int) -> None:
    with pytest.raises(RuntimeError, match=r"actionkit interfaces build --own --install"):
        servers.start(
            "countdown",
            domain_id=ros_domain,
            action_type="actionkit_interfaces/action/Countdown",
        )


# --- two versions of a type ------------------------------------------------------------------

OTHER_VERSION = """
import subprocess, sys
from actionkit import ActionTypeMismatchError, Client
from test_msgs.action import Fibonacci
with Client(Fibonacci, "fibonacci") as client:
    for _ in range(2):  # also when it is known
        try:
            print(client.call(Fibonacci.Goal(order=5), timeout=30.0))
        except ActionTypeMismatchError as error:
            print(error)
            assert len(error.served) == 1
    assert not client.server_is_ready()
    def tell():
        for words in sys.argv[1:]:
            command = [sys.executable, "-m", "actionkit", *words.split()]
            print(subprocess.run(command, capture_output=True, text=True).stdout)
    tell()
print("WITHOUT A CLIENT")
tell()
"""
TOLD_BY = {
    "list --wait 4": "/fibonacci (in two versions: see `actionkit info`)",
    "info /fibonacci --wait 4": "Two versions of the result: server RIHS01_",
    "doctor /fibonacci --wait 4": "/fibonacci has two versions of its result: server RIHS01_",
}
"""What each command says of the version that has another result."""
TOLD_WITHOUT_CLIENT = (
    "/fibonacci (another version is installed here: see `actionkit info`)",
    "Another version is installed here: result: server RIHS01_",
    "/fibonacci is served with another version of its type than is installed here: result: server",
)


@pytest.mark.heavy
@pytest.mark.parametrize(
    ("end", "fields"),
    [
        pytest.param(
            "goal", ("int64 order", "int32[] sequence", "int32[] sequence"), marks=pytest.mark.long
        ),
        ("result", ("int32 order", "int16[] sequence", "int32[] sequence")),
        pytest.param(
            "feedback", ("int32 order", "int32[] sequence", "int8 more"), marks=pytest.mark.long
        ),
    ],
)
@pytest.mark.long
def test_nothing_is_sent_to_a_server_with_another_version(
    end: str, fields: tuple[str, ...], tmp_path: Path, ros_domain: int
) -> None:
    text = "\n---\n".join(fields) + "\n"
    write_package(tmp_path / "src" / "test_msgs", {"action/Fibonacci.action": text})
    built = tmp_path / "built"
    build_shadowing(tmp_path / "src", built)
    with servers.start("fibonacci", domain_id=ros_domain) as server:
        env = environment(built, ROS_DOMAIN_ID=str(ros_domain))
        words = TOLD_BY if end == "result" else ()
        first, again, commands = run_python(OTHER_VERSION, *words, env=env).split("\n", 2)
        server.sync()
        assert server.count("goal_received") == 0
    assert first == again
    assert first.startswith(
        "Action '/fibonacci' is served with another version of the type:"
        f" test_msgs/action/Fibonacci ({end}: server RIHS01_"
    )
    assert first.endswith("; nothing was sent. Build both sides from the same .action file.")
    if words:
        beside, alone = " ".join(commands.split()).split("WITHOUT A CLIENT")
        assert all(told in beside for told in TOLD_BY.values()), commands
        assert all(told in alone for told in TOLD_WITHOUT_CLIENT), commands


TOOLS = """
import json, sys
from actionkit.agents import Toolbox
action = {"action": "/go", "type": "actionkit_interfaces/action/NavigateToPose", "expose": "all"}
toolbox = Toolbox.from_config({"tools": {"go": action}})
tool = next(tool for tool in toolbox.tools if tool.name == "go")
print(json.dumps([tool.input_schema, tool.output_schema["properties"]["feedback"]]))
"""


@pytest.mark.long
def test_tools_for_models_tell_the_units_that_show_tells(own: Path) -> None:
    goal, feedback = json.loads(run_python(TOOLS, env=environment(own)))
    shown = actionkit(
        "show", "actionkit_interfaces/action/NavigateToPose", env=environment(own)
    ).stdout
    assert "Drive to a pose." in shown
    assert goal["description"] == "Drive to a pose."
    speed = "The most that the robot may drive, in m/s. 0: as fast as it likes."
    assert f"# {speed}\nmax_velocity: 0.0" in shown
    assert goal["properties"]["max_velocity"]["description"] == speed
    left = "How far it still has to drive, in m."
    assert f"#   # {left}\n#   distance_remaining: 0.0" in shown
    assert left in feedback["properties"]["distance_remaining"]["description"]

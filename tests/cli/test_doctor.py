"""`actionkit doctor`: what is wrong is found, and each finding says what to do. Contract C6.3."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from actionkit.cli._shared.exits import Exit
from actionkit.cli.doctor._findings import Finding, problem
from actionkit.cli.doctor._graph import missing, round_trip_findings
from actionkit.cli.doctor._machine import origin, rclpy_places, rclpy_version, shared_memory
from actionkit.cli.doctor._settings import settings
from tests.cli.conftest import FIBONACCI, PATIENCE, Done, World


def findings(done: Done) -> list[Finding]:
    """Read what `--json` wrote."""
    records = [json.loads(line) for line in done.out.splitlines()]
    return [Finding(r["level"], r["topic"], r["text"], r["remedy"] or "") for r in records]


def of(topic: str, found: list[Finding]) -> list[Finding]:
    return [finding for finding in found if finding.topic == topic]


@pytest.mark.long
def test_a_server_that_works_is_measured_by_phase_and_not_touched(world: World) -> None:
    server = world.server("fibonacci")
    done = world.run("doctor", "fibonacci", "--json", "--wait", "1")
    found = findings(done)
    assert done.code == Exit.OK, found
    assert [finding.topic for finding in found if finding.level == "problem"] == []
    for topic in ("python", "rclpy", "ROS_DOMAIN_ID", "middleware"):
        assert of(topic, found), topic
    assert "wheels" in of("rclpy", found)[0].text or "installation" in of("rclpy", found)[0].text
    assert f"domain {world.domain}" in of("middleware", found)[0].text
    assert FIBONACCI in of("server", found)[0].text
    assert "was seen after" in of("discovery", found)[0].text
    (trip,) = of("round trip", found)
    for phase in ("endpoints matched in", "first answer after", "median of 5"):
        assert phase in trip.text
    # All that the server saw were questions about goals that it does not have.
    asked = server.wait_for("cancel_requested", count=7)
    assert not any(event.details["running"] for event in asked)
    assert server.count("goal_received") == 0

    plain = world.run("doctor", "--wait", "1")
    assert plain.code == Exit.OK
    assert plain.out.endswith("\nNo problem was found.\n")
    assert "/fibonacci" in plain.out


@pytest.mark.long
def test_a_server_that_does_not_answer_is_told_from_one_that_is_not_there(
    empty_world: World,
) -> None:
    server = empty_world.server("fibonacci")
    typo = empty_world.run("doctor", "/fibonaci", "--json", "--wait", "1")
    assert typo.code == Exit.FAILED
    (missing,) = of("servers", findings(typo))
    assert "Did you mean /fibonacci?" in missing.text
    assert str(empty_world.domain) in missing.remedy

    server.pause()
    try:
        silent = empty_world.run("doctor", "/fibonacci", "--json", "--wait", "1")
    finally:
        server.resume()
    assert silent.code == Exit.FAILED
    trip = findings(silent)[-1]
    assert (trip.level, trip.topic) in (("problem", "round trip"), ("problem", "servers"))
    assert trip.remedy


@pytest.mark.long
def test_clients_of_another_type_are_found(empty_world: World) -> None:
    empty_world.server("wrong_type")
    caller = empty_world.start(
        "call", "wrong_type", FIBONACCI, "--server-timeout", "60", "--retries", "9"
    )
    caller.until("Waiting")
    caller.finish()  # tells the mismatch by itself
    empty_world.server("twins")
    done = empty_world.run("doctor", "twins", "--json", "--wait", "1")
    (two,) = of("servers", findings(done))
    assert (two.level, done.code) == ("note", Exit.OK)
    assert "2 servers in one process" in two.text
    assert two.remedy.startswith("Start that program again.")


@pytest.mark.long
@pytest.mark.parametrize(
    ("before", "environment", "told", "remedy"),
    [
        ("import sys; sys.modules['rclpy'] = None", {}, "not found", "pip install"),
        ("", {"RMW_IMPLEMENTATION": "rmw_nothing_cpp"}, "rmw_nothing_cpp", "unset it"),
        ("", {"PYTHONPATH": "BROKEN"}, "No module named 'librclpy'", "setup file"),
    ],
    ids=["missing", "wrong middleware", "broken"],
)
def test_an_rclpy_that_does_not_work_is_told(
    before: str,
    environment: dict[str, str],
    told: str,
    remedy: str,
    empty_world: World,
    tmp_path: Path,
) -> None:
    if "PYTHONPATH" in environment:
        broken = tmp_path / "rclpy" / "__init__.py"
        broken.parent.mkdir()
        broken.write_text("import librclpy\n", "utf-8")
        environment = {"PYTHONPATH": str(tmp_path)}
    done = empty_world.run_apart("doctor", "--json", before=before, **environment)
    found = findings(done)
    assert done.code == Exit.NO_ROS, found
    (rclpy,) = [f for f in of("rclpy", found) if f.level == "problem"]
    assert told in rclpy.text
    assert remedy in rclpy.remedy
    # The settings are told all the same, and nobody tries to join the graph.
    assert of("ROS_DOMAIN_ID", found)
    assert not of("middleware", found)


def test_a_port_that_a_killed_process_did_not_finish(tmp_path: Path) -> None:
    left = {"7001": b"", "7002": bytes(4096), "7003": b"\1\0\0\0\0\0\0\0"}
    # In use; marked as broken, in two ways; a file for locks.
    well = {"7004": b"\2\0\0\0\0\0\0\0", "7005": b"\3\0\0\0", "7006": b"\0", "7007_el": b""}
    for name, content in {**left, **well}.items():
        (tmp_path / f"fastrtps_port{name}").write_bytes(content)
    (tmp_path / "fastrtps_port7008").mkdir()
    os.mkfifo(tmp_path / "fastrtps_port7009")
    found = list(shared_memory(tmp_path, lambda _: None))
    assert {(finding.level, finding.topic) for finding in found} == {("problem", "shared memory")}
    for finding, name in zip(found, left, strict=True):
        assert finding.text.startswith(f"{tmp_path}/fastrtps_port{name} is unfinished")
        assert "kill -9" in finding.remedy
        assert finding.remedy.endswith(f"rm {tmp_path}/fastrtps_port{name}")
    assert list(shared_memory(tmp_path / "missing")) == []


def test_a_port_that_is_being_made_is_no_finding(tmp_path: Path) -> None:
    paths = [tmp_path / f"fastrtps_port{number}" for number in (7001, 7002, 7003)]
    finished, removed, late = paths
    finished.touch()
    removed.touch()
    os.utime(removed, (time.time() - 60,) * 2)
    waits = []

    def others_go_on(seconds: float) -> None:
        waits.append(seconds)
        finished.write_bytes(b"\2\0\0\0")
        removed.unlink()
        late.touch()

    assert list(shared_memory(tmp_path, others_go_on)) == []
    late.unlink()
    assert list(shared_memory(tmp_path, others_go_on)) == []
    assert waits == [2.0], "nothing was unfinished the second time"


_AS_ANOTHER_USER = """
import os, sys
from pathlib import Path
from actionkit.cli.doctor._machine import shared_memory
if os.getuid() == 0:
    os.setuid(54321)
print(*(finding.remedy for finding in shared_memory(Path(sys.argv[1]), lambda _: None)))
"""


def test_a_port_that_this_user_cannot_open_is_no_finding() -> None:
    with tempfile.TemporaryDirectory(dir="/tmp") as folder:
        Path(folder).chmod(0o755)
        for number, mode in (7001, 0o000), (7002, 0o444), (7003, 0o666):
            path = Path(folder) / f"fastrtps_port{number}"
            path.touch()
            path.chmod(mode)
        words = [sys.executable, "-c", _AS_ANOTHER_USER, folder]
        told = subprocess.run(words, capture_output=True, text=True, check=True).stdout
    assert told.endswith(f"rm {folder}/fastrtps_port7003\n")
    assert told.count("rm ") == 1


_OWN_SHARED_MEMORY = ["unshare", "--mount", *([] if os.getuid() == 0 else ["--map-root-user"])]
# Each node opens the port 7000, in every domain.
_LEAVE = 'mount -t tmpfs none /dev/shm && touch /dev/shm/fastrtps_port7000 && exec "$@"'
_WHERE_NODES_HANG = [*_OWN_SHARED_MEMORY, "sh", "-c", _LEAVE, "sh"]


def can_make_nodes_hang() -> bool:
    done = subprocess.run([*_WHERE_NODES_HANG, "true"], check=False, capture_output=True)
    return done.returncode == 0


@pytest.mark.long
def test_it_does_not_hang_where_nodes_do(empty_world: World) -> None:
    """In a /dev/shm of its own, or other programs would hang there, too."""
    if shutil.which("unshare") is None or not can_make_nodes_hang():
        pytest.skip("needs the right to mount a /dev/shm of its own")
    done = subprocess.run(
        [*_WHERE_NODES_HANG, sys.executable, "-m", "actionkit", "doctor", "--json"],
        capture_output=True,
        text=True,
        env=empty_world.environment,
        timeout=2 * PATIENCE,
        check=False,
    )
    found = findings(Done(done.returncode, done.stdout, done.stderr))
    assert done.returncode == Exit.FAILED, done
    (left,) = of("shared memory", found)
    assert left.remedy.endswith("; then: rm /dev/shm/fastrtps_port7000")
    # The settings are told all the same, and nobody tries to join the graph.
    assert of("ROS_DOMAIN_ID", found)
    assert not of("middleware", found)


_APART = [*_OWN_SHARED_MEMORY, "sh", "-c", 'mount -t tmpfs none /dev/shm && exec "$@"', "sh"]


@pytest.mark.long
def test_a_server_in_another_container_is_in_sight_and_sends_nothing(empty_world: World) -> None:
    """Containers have a /dev/shm of their own each; discovery goes by UDP, data does not."""
    if shutil.which("unshare") is None or not can_make_nodes_hang():
        pytest.skip("needs the right to mount a /dev/shm of its own")
    serve = [sys.executable, "-m", "actionkit.servers", "fibonacci"]
    env = empty_world.environment
    with subprocess.Popen([*_APART, *serve], stdout=subprocess.PIPE, env=env) as server:
        assert server.stdout is not None
        assert b"ready" in server.stdout.readline()
        goal = ("fibonacci", "test_msgs/action/Fibonacci", "{order: 3}", "--timeout", "15")
        called = empty_world.run("call", *goal)
        done = empty_world.run("doctor", "fibonacci", "--json")
        server.terminate()
    assert "no data from it arrives here" in called.err
    assert "busy" not in called.err
    (data,) = of("data", findings(done))
    assert "With UDP alone it answers" in data.text


@pytest.mark.long
def test_that_no_server_was_started_yet_is_no_problem(empty_world: World) -> None:
    done = empty_world.run("doctor", "--json", "--wait", "0.1")
    assert done.code == Exit.OK
    (servers,) = of("servers", findings(done))
    assert (servers.level, servers.text) == ("note", "no action server is in sight.")


@pytest.mark.long
def test_settings_that_keep_everybody_apart_are_problems(empty_world: World) -> None:
    apart = {"ROS_DOMAIN_ID": "robot", "ROS_AUTOMATIC_DISCOVERY_RANGE": "OFF"}
    done = empty_world.run_apart("doctor", **apart)
    assert done.code == Exit.FAILED
    assert "Problems found: 2." in done.out
    assert done.out.count("->") >= 2


@pytest.mark.parametrize(
    ("variable", "value", "level", "told", "remedy"),
    [
        ("ROS_DOMAIN_ID", "", "ok", "domain 0", ""),
        ("ROS_DOMAIN_ID", "7", "ok", "7", ""),
        ("ROS_DOMAIN_ID", "150", "note", "above 101", "0 to 101"),
        ("ROS_DOMAIN_ID", "233", "problem", "not a ROS domain", "ROS_DOMAIN_ID=0"),
        ("ROS_DOMAIN_ID", "010", "note", "domain 8", "ROS_DOMAIN_ID=8"),
        ("ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET", "ok", "SUBNET", ""),
        ("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF", "problem", "no node sees", "SUBNET"),
        ("ROS_AUTOMATIC_DISCOVERY_RANGE", "LAN", "problem", "'LAN'", "SUBNET, LOCALHOST"),
        ("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST", "note", "this machine", "SUBNET"),
        ("ROS_LOCALHOST_ONLY", "1", "note", "overrules", "RANGE=LOCALHOST"),
        ("ROS_LOCALHOST_ONLY", "0", "note", "all hosts", "RANGE=SUBNET"),
        ("ROS_STATIC_PEERS", "10.0.0.2", "note", "10.0.0.2", "unset"),
        ("ROS_DISCOVERY_SERVER", "10.0.0.2:11811", "note", "only nodes", "ROS_SUPER_CLIENT"),
        ("FASTDDS_DEFAULT_PROFILES_FILE", "/not/there.xml", "problem", "not there", "unset"),
        ("CYCLONEDDS_URI", "<CycloneDDS/>", "note", "discovery", "unset"),
        ("ROS_SECURITY_ENABLE", "", "ok", "security is off", ""),
        ("ROS_SECURITY_ENABLE", "1", "problem", "'1' does not switch", "ROS_SECURITY_ENABLE=true"),
        ("ROS_SECURITY_ENABLE", "true", "note", "does not name the folder", "STRATEGY=Enforce"),
        ("RMW_IMPLEMENTATION", "rmw_fastrtps_cpp", "ok", "the same", ""),
    ],
)
@pytest.mark.every
def test_each_setting(variable: str, value: str, level: str, told: str, remedy: str) -> None:
    (finding,) = [found for found in settings({variable: value}) if found.topic == variable]
    assert finding.level == level
    assert told in finding.text
    assert remedy in finding.remedy


def test_a_finding_needs_a_remedy() -> None:
    with pytest.raises(ValueError, match="without a remedy"):
        problem("rclpy", "not found", "")


def test_where_an_rclpy_comes_from() -> None:
    place = Path("/opt/ros/jazzy/lib/python3.12/site-packages/rclpy")
    assert origin(place) == "the ROS installation /opt/ros/jazzy"


def test_the_version_is_that_of_the_rclpy_that_is_used(tmp_path: Path) -> None:
    """Another one may be installed further back on Python's path, as this one's wheels are."""
    told = tmp_path / "rclpy-9.8.7.dist-info" / "METADATA"
    told.parent.mkdir()
    told.write_text("Metadata-Version: 2.1\nName: rclpy\nVersion: 9.8.7\n", "utf-8")
    assert rclpy_version(tmp_path / "rclpy") == "9.8.7"
    assert origin(tmp_path / "rclpy") == "a workspace or another installation"
    assert rclpy_version(rclpy_places()[0])[0].isdigit()


def test_it_does_not_advise_itself() -> None:
    text = missing("/nothing", {}, 0).text
    assert text.endswith("has no server in sight. `actionkit list` shows the actions in sight.")


def trip(**parts: Any) -> Any:
    usual = {
        "matched": 0.01, "first": 0.002, "asked": 1, "later": (0.001,) * 5, "answers": 1,
    }  # fmt: skip
    return SimpleNamespace(**{**usual, **parts})


@pytest.mark.parametrize(
    ("parts", "servers", "levels", "told"),
    [
        ({}, 1, ["ok"], "endpoints matched in 10 ms, first answer after 2.0 ms, then 1.0 ms"),
        ({"matched": None}, 1, ["problem"], "not matched"),
        ({"first": None, "asked": 5}, 1, ["problem"], "none of 5 questions"),
        ({"asked": 3}, 1, ["ok", "note"], "2 questions were lost"),
        ({"later": (0.3,) * 5}, 1, ["ok", "note"], "more than 100 ms"),
        ({"answers": 1}, 2, ["ok", "note"], "1 of 2 servers answer"),
    ],
)
def test_a_round_trip_is_judged(
    parts: dict[str, Any], servers: int, levels: list[str], told: str
) -> None:
    findings: list[Finding] = list(round_trip_findings("/fibonacci", servers, trip(**parts)))
    assert [finding.level for finding in findings] == levels
    assert told in findings[-1].text

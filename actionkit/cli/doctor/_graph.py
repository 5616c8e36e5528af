"""The checks of `actionkit doctor` on the servers in sight, and on how fast one answers."""

from __future__ import annotations

import importlib.util
import statistics
import subprocess
import sys
from collections.abc import Iterator
from typing import TYPE_CHECKING

from actionkit.cli._shared.no_server import nothing_there
from actionkit.cli._shared.versions import not_ours
from actionkit.cli.doctor._findings import Finding, note, ok, problem

if TYPE_CHECKING:
    from actionkit._ros.others_goals.survey import ActionSeen, Survey
    from actionkit._ros.tools.roundtrip import RoundTrip

_ROUND_TRIP = 5.0
"""Seconds to wait for an answer; a busy server takes up to a few."""
_SLOW = 0.1
"""Seconds; slower answers get a note. On one machine an answer takes about a millisecond."""
_LISTED = 10
"""Servers that are listed, each with its own line."""


def actions_in_sight(survey: Survey, name: str | None, wait: float) -> Iterator[Finding]:
    """Yield findings about the graph, and about one action if it is named.

    `name` is the full name of an action, or `None`. Look for at least `wait` seconds.
    """
    yield ok(
        "middleware",
        f"{survey.middleware}, domain {survey.domain_id}; a node was made in"
        f" {survey.seconds_to_open * 1000:.0f} ms",
    )
    actions = survey.settled(
        least=wait,
        enough=lambda seen: bool(seen) if name is None else name in seen,
    )
    served = {key: action for key, action in actions.items() if action.servers}
    if name is None:
        yield from _all(survey, served)
        return
    action = served.get(name)
    if action is None:
        yield missing(name, actions, survey.domain_id)
        return
    seconds = survey.first_seen.get(name, 0.0)
    yield ok("discovery", f"a server of {name} was seen after {seconds * 1000:.0f} ms")
    yield from _one(survey, action)
    from actionkit._ros.tools.roundtrip import measure

    trip = measure(name, _ROUND_TRIP)
    silent = trip.first is None and not any(server.node for server in action.servers)
    if silent:
        yield _no_data(name)
    else:
        yield from round_trip_findings(name, len(action.servers), trip)


def _all(survey: Survey, served: dict[str, ActionSeen]) -> Iterator[Finding]:
    if not served:
        yield note(
            "servers",
            "no action server is in sight.",
            "If there should be one: start it (`actionkit serve fibonacci` is one to try), in the"
            " same domain and within the range of discovery; see the settings above. Multicast may"
            " be blocked by a firewall, a container or a wireless network: ROS_STATIC_PEERS goes"
            " without it.",
        )
        return
    for action in list(served.values())[:_LISTED]:
        yield from _one(survey, action)
    if len(served) > _LISTED:
        yield ok("servers", f"and {len(served) - _LISTED} more; `actionkit list` shows all")


def missing(name: str, actions: dict[str, ActionSeen], domain: int) -> Finding:
    """Return what to do about an action without a server in sight."""
    clients = actions[name].clients if name in actions else ()
    waiting = f" Waiting for one are: {_nodes(clients)}." if clients else ""
    return problem(
        "servers",
        nothing_there(name, actions, doctor=True) + waiting,
        "Correct the name, its namespace included, or start the server: in domain"
        f" {domain}, within the range of discovery.",
    )


def _one(survey: Survey, action: ActionSeen) -> Iterator[Finding]:
    name, types = action.name, action.types
    yield ok("server", f"{name} [{', '.join(types)}] by {_nodes(action.servers)}")
    if len(types) > 1:
        yield problem(
            "type",
            f"{name} is served with {len(types)} types: {', '.join(types)}.",
            "One of the servers has the wrong type or name: remap or stop it.",
        )
    elif len(action.servers) > 1:
        one_process = len({end.participant for end in action.servers}) == 1
        yield note(
            "servers",
            f"{name} has {len(action.servers)} servers{' in one process' if one_process else ''}:"
            " each goal is run by all of them.",
            "Start that program again. If it has two again, change it: it is to make one only."
            if one_process
            else "Stop all but one. Right after a restart it is the old one that is not forgotten"
            " so far, for up to 20 s.",
        )
    wrong = sorted({end.action_type for end in action.clients} - set(types))
    if wrong:
        yield problem(
            "type",
            f"{name} is served as {', '.join(types)}, but clients ask for {', '.join(wrong)}.",
            "Those clients wait for ever: give them the served type, or another name.",
        )
    for versions in survey.versions(name):
        if versions.differ:
            yield problem(
                "type",
                f"{name} has two versions of its {versions}.",
                "Build both sides from the same .action file: each misreads what the other sends.",
            )
    if different := not_ours(survey, action):
        yield problem(
            "type",
            f"{name} is served with another version of its type than is installed here:"
            f" {different}.",
            "A call from here is refused: build both sides from the same .action file.",
        )
    for kind in types:
        package = kind.split("/", 1)[0]
        if importlib.util.find_spec(package) is None:
            yield note(
                "package",
                f"{package}, which {name} needs, cannot be imported here.",
                f"Source the workspace that has {package}, or install it; without it nothing here"
                " can call the action.",
            )


def round_trip_findings(name: str, servers: int, trip: RoundTrip) -> Iterator[Finding]:
    """Yield findings about a round trip to an action with this number of servers in sight."""
    if trip.matched is None:
        yield problem(
            "round trip",
            f"the services of {name} were not matched within {_ROUND_TRIP:g} s.",
            "The server was seen, but is not reached: it was killed a moment ago (it stays in"
            " sight for up to 20 s), or data is blocked where discovery is not. Check firewalls,"
            " and shared memory between containers: run them with --ipc=host.",
        )
        return
    text = f"endpoints matched in {trip.matched * 1000:.0f} ms"
    if trip.first is None:
        yield problem(
            "round trip",
            f"{text}, but none of {trip.asked} questions was answered in {_ROUND_TRIP:g} s.",
            "The server's process is stopped or was killed, or the only thread of its executor is"
            " busy in a callback: look at its log, and have it use a MultiThreadedExecutor.",
        )
        return
    text += f", first answer after {trip.first * 1000:.1f} ms"
    if trip.later:
        text += (
            f", then {statistics.median(trip.later) * 1000:.1f} ms (median of {len(trip.later)};"
            f" {min(trip.later) * 1000:.1f} to {max(trip.later) * 1000:.1f})"
        )
    yield ok("round trip", f"{text}. The question: to cancel a goal that nobody knows")
    if trip.asked > 1:
        yield note(
            "round trip",
            f"{trip.asked - 1} questions were lost before the first answer.",
            "Right after its start a server may not know the way back; if it goes on, the network"
            " loses packets or the server is overloaded.",
        )
    if trip.later and statistics.median(trip.later) > _SLOW:
        yield note(
            "round trip",
            f"an answer takes more than {_SLOW * 1000:g} ms.",
            "The server's executor has too much to do in too few threads, or the network is slow.",
        )
    if trip.answers < servers:
        yield note(
            "round trip",
            f"{trip.answers} of {servers} servers answer.",
            "The silent one was killed, and is not forgotten so far, or is busy in its only"
            " thread.",
        )


def _no_data(name: str) -> Finding:
    """Return what is wrong where servers are in sight, but nothing that they send arrives."""
    seen = f"the server of {name} is in sight, but no data from it arrives here"
    if _answers_by_udp(name):
        return problem(
            "data",
            f"{seen}. With UDP alone it answers: the two sides share no memory.",
            "It runs in another container, or as another user: start the containers with"
            " --ipc=host, or both programs with FASTDDS_BUILTIN_TRANSPORTS=UDPv4.",
        )
    return problem(
        "data",
        f"{seen}, also with UDP alone.",
        "A firewall may let only discovery through: allow UDP in both directions. Or the server was"
        " killed a moment ago (it stays in sight for up to 20 s), or is busy in its only thread.",
    )


_BY_UDP = """
import sys
sys.path[:] = sys.argv[2:]
from actionkit._ros.workarounds.udp_only import use_udp_only
use_udp_only()
from actionkit._ros.tools.roundtrip import measure
print(measure(sys.argv[1], float(5)).answers)
"""


def _answers_by_udp(name: str) -> bool:
    """Whether the server answers a process that uses no shared memory."""
    command = [sys.executable, "-c", _BY_UDP, name, *sys.path]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    return done.returncode == 0 and done.stdout.strip() not in ("", "0")


def _nodes(ends: tuple[object, ...]) -> str:
    return ", ".join(getattr(end, "node", "") or "(a node not known yet)" for end in ends)

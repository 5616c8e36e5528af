"""The checks of `actionkit doctor` on the environment variables for discovery. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

from actionkit._model.environment.domain import LAST_DOMAIN, domain_of_text
from actionkit._model.environment.security import KEYSTORE, ON, OVERRIDE, STRATEGY, security
from actionkit.cli.doctor._findings import Finding, note, ok, problem

_RANGES = ("SUBNET", "LOCALHOST", "OFF", "SYSTEM_DEFAULT")
_SAFE = 101
"""Higher domains use ports that Linux may give to any program."""
_PROFILES = (
    "FASTDDS_DEFAULT_PROFILES_FILE",
    "FASTRTPS_DEFAULT_PROFILES_FILE",
    "CYCLONEDDS_URI",
)


def settings(environment: Mapping[str, str]) -> Iterator[Finding]:
    """Yield findings about domain, discovery and middleware settings."""
    yield _domain(environment.get("ROS_DOMAIN_ID", ""))
    yield from _range(environment)
    if peers := environment.get("ROS_STATIC_PEERS", ""):
        yield note(
            "ROS_STATIC_PEERS",
            f"{peers!r}: these hosts are looked for beside those in range.",
            "Where a host of the list does not answer, correct or unset it. Separate several by"
            " a semicolon.",
        )
    if server := environment.get("ROS_DISCOVERY_SERVER", ""):
        yield _discovery_server(server, environment)
    for name in _PROFILES:
        if value := environment.get(name, ""):
            yield _profile(name, value)
    yield _security(environment)
    if rmw := environment.get("RMW_IMPLEMENTATION", ""):
        yield ok("RMW_IMPLEMENTATION", f"{rmw}; it must be the same for server and client")


def _domain(text: str) -> Finding:
    if not text:
        return ok("ROS_DOMAIN_ID", "not set: domain 0")
    try:
        domain = domain_of_text(text)
    except ValueError:
        return problem(
            "ROS_DOMAIN_ID",
            f"{text!r} is not a ROS domain, which is a whole number from 0 to {LAST_DOMAIN}.",
            f"export ROS_DOMAIN_ID=0, or whichever is that of the server; best up to {_SAFE}.",
        )
    if text != str(domain):
        return note(
            "ROS_DOMAIN_ID",
            f"{text!r} is read as domain {domain}.",
            f"export ROS_DOMAIN_ID={domain} if you mean that; that of the server must be the same.",
        )
    if domain > _SAFE:
        return note(
            "ROS_DOMAIN_ID",
            f"{text}: the network ports of domains above {_SAFE} may be taken by any program.",
            f"Use a domain from 0 to {_SAFE}, for all nodes alike.",
        )
    return ok("ROS_DOMAIN_ID", f"{text}; that of the server must be the same")


def _range(environment: Mapping[str, str]) -> Iterator[Finding]:
    value = environment.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "")
    old = environment.get("ROS_LOCALHOST_ONLY", "")
    if old:
        only = old == "1"
        yield note(
            "ROS_LOCALHOST_ONLY",
            f"{old!r}: deprecated, and it overrules ROS_AUTOMATIC_DISCOVERY_RANGE. "
            + ("Only nodes on this machine are seen." if only else "Nodes on all hosts are seen."),
            f"Unset it; ROS_AUTOMATIC_DISCOVERY_RANGE={'LOCALHOST' if only else 'SUBNET'} says the"
            " same.",
        )
    topic = "ROS_AUTOMATIC_DISCOVERY_RANGE"
    if not value:
        yield ok(topic, "not set: nodes in the whole subnet are seen")
    elif value not in _RANGES:
        yield problem(
            topic,
            f"{value!r} is not known, and so taken for LOCALHOST.",
            f"Use {_one_of(_RANGES)}.",
        )
    elif value == "OFF":
        yield problem(
            topic,
            "OFF: no node sees any other.",
            "Unset it, or set it to SUBNET or LOCALHOST, for the server as well.",
        )
    elif value == "LOCALHOST":
        yield note(
            topic,
            "LOCALHOST: only nodes on this machine are seen.",
            "For a server on another machine: set it to SUBNET on both, or name the other in"
            " ROS_STATIC_PEERS.",
        )
    else:
        yield ok(topic, value)


def _discovery_server(server: str, environment: Mapping[str, str]) -> Finding:
    super_client = environment.get("ROS_SUPER_CLIENT", "").upper() in ("TRUE", "1")
    return note(
        "ROS_DISCOVERY_SERVER",
        f"{server!r}: only nodes that use this discovery server are seen"
        + ("." if super_client else ", and the graph is not shown whole to plain clients."),
        "Set the same for the action server's process, and check that the discovery server runs."
        + ("" if super_client else " For list, info and doctor set ROS_SUPER_CLIENT=TRUE, too."),
    )


def _profile(name: str, value: str) -> Finding:
    path = Path(value.removeprefix("file://"))
    if "<" not in value and not path.is_file():
        return problem(name, f"{value!r} is not there.", f"Correct the path, or unset {name}.")
    return note(
        name,
        f"{value!r}: a profile may switch off transports or discovery.",
        f"Try once with {name} unset; server and client need profiles that fit.",
    )


def _security(environment: Mapping[str, str]) -> Finding:
    found = security(environment, ())
    value = environment.get(ON, "")
    if found is None and value not in ("", "false"):
        return problem(
            ON,
            f"{value!r} does not switch security on: only 'true' does.",
            f"export {ON}=true, or unset it; the same for the server.",
        )
    if found is None:
        return ok(ON, "security is off; servers of a secured graph are not seen")
    told = f"security is on, as enclave {found.enclave!r} of the keystore {found.keystore!r}"
    choose = (
        f"Correct {KEYSTORE}, name the enclave in {OVERRIDE}, or make it: ros2 security"
        " create_enclave KEYSTORE ENCLAVE. A program may name its own with --ros-args --enclave."
    )
    if not found.enforced:
        return note(
            ON,
            f"{told}, but not enforced: without all files, all goes on without security."
            + (f" {found.problem()}" if found.problem() else ""),
            f"export {STRATEGY}=Enforce" + (f". {choose}" if found.problem() else ""),
        )
    if found.problem():
        return problem(ON, f"{told}. {found.problem()}", choose)
    return ok(ON, f"{told}; its files are there, and servers of the same keystore are seen")


def _one_of(words: tuple[str, ...]) -> str:
    return f"{', '.join(words[:-1])} or {words[-1]}"

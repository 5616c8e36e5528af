"""Describes the ROS graph at the moment when a call finds no server, for its error (C3.2)."""

from __future__ import annotations

from dataclasses import dataclass

from actionkit._model.similar_names import similar_names

DISCOVERY = 3.0
"""Seconds until a running server is visible, on a machine that is busy with other work."""


@dataclass(frozen=True)
class GraphSnapshot:
    """The served actions, and the settings that decide which of them are visible."""

    actions: dict[str, tuple[str, ...]] | None  # every served name with its types; None: no graph

    domain_id: int
    middleware: str
    best_effort: tuple[str, ...] = ()  # this action's services that are served so
    no_data: bool = False  # whether this action's servers are in sight, but nothing of them arrives
    only_publishing: tuple[str, ...] = ()  # nodes that publish its feedback, and do not serve it
    age: float = 60.0  # seconds since our node entered the graph
    enclave: str = ""  # of this process, where security is on


def seen_instead(graph: GraphSnapshot, action_name: str, type_name: str) -> str:
    """Return sentences about the visible servers, and about where to look for the missing one."""
    parts = []
    actions = graph.actions or {}
    if type_name in actions.get(action_name, ()):
        if graph.best_effort:
            return (
                "A server of this name and type is visible, but best-effort for"
                f" {_and(graph.best_effort)}. It is not connected with clients, which are reliable."
                " Make it reliable, too: its QoS profiles are so by default."
            )
        if graph.no_data:
            return no_data(action_name)
        return (
            "A server of this name and type is visible, but has not answered this client yet: it"
            " is just starting, or this machine or the server is too busy. Allow it more time."
        )
    if action_name in actions:
        return (
            f"That name is served as {', '.join(actions[action_name])}: use this type, or the name"
            " of a server of your type."
        )
    if graph.only_publishing:
        parts.append(
            f"Its feedback is published by {_and(graph.only_publishing)}, without its services:"
            " that is a bag player, a relay or a bridge, and not a server."
        )
    close = similar_names(action_name, sorted(actions))
    if close:
        parts.append("Served under a similar name: " + _listed(close, actions) + ".")
    same = [n for n, types in sorted(actions.items()) if type_name in types]
    same = [name for name in same if name not in close]
    if same:
        parts.append("Served with the same type under another name: " + _listed(same) + ".")
    if graph.actions is None:
        parts.append("The ROS context was shut down, so the graph cannot be asked.")
    elif not actions:
        parts.append(
            "No action server at all is visible."
            if graph.age > DISCOVERY
            else "No action server has come into sight so far."
        )
    parts.append(
        f"Check that the server runs, and in the same domain (here ROS_DOMAIN_ID="
        f"{graph.domain_id}, {graph.middleware})."
    )
    if graph.enclave:
        parts.append(
            f"ROS security is on, as enclave {graph.enclave!r}: only servers with keys of the same"
            " keystore are seen."
        )
    return " ".join(parts)


def no_data(action_name: str) -> str:
    """Return sentences about a server that is visible, but that cannot send anything to here."""
    return (
        "The server is visible, but no data from it arrives here. It may run in another container"
        " or as another user, without shared memory in common: start the containers with"
        " --ipc host, or both programs with FASTDDS_BUILTIN_TRANSPORTS=UDPv4. Or a firewall lets"
        f" only discovery through. Try `actionkit doctor {action_name}`."
    )


def _and(words: tuple[str, ...]) -> str:
    return " and ".join(filter(None, (", ".join(words[:-1]), words[-1])))


def _listed(names: list[str], actions: dict[str, tuple[str, ...]] | None = None) -> str:
    shown = [
        repr(name) + (f" ({', '.join(actions[name])})" if actions else "") for name in names[:5]
    ]
    return ", ".join(shown) + (" and more" if len(names) > len(shown) else "")

"""What the graph shows around a call that found no server, and how an error tells of it (C3.2)."""

from __future__ import annotations

from dataclasses import dataclass

from actionkit._model.similar_names import similar_names


@dataclass(frozen=True)
class GraphSnapshot:
    """What the graph shows around a call.

    Attributes:
        actions: Every served action name with its types; `None` where the graph is gone.
        domain_id: The ROS domain in use.
        middleware: The middleware in use.
    """

    actions: dict[str, tuple[str, ...]] | None
    domain_id: int
    middleware: str


def seen_instead(around: GraphSnapshot, action_name: str, type_name: str) -> str:
    """Say which servers are there, and where to look for the one that is not (C3.2)."""
    parts = []
    actions = around.actions or {}
    if type_name in actions.get(action_name, ()):
        return (
            "A server of this name and type is visible, but has not answered this client yet: it"
            " is just starting, or this machine or the server is too busy. Allow it more time."
        )
    close = similar_names(action_name, sorted(actions))
    if close:
        parts.append("Served under a similar name: " + _listed(close, actions) + ".")
    same = [n for n, types in sorted(actions.items()) if type_name in types]
    same = [name for name in same if name not in close]
    if same:
        parts.append("Served with the same type under another name: " + _listed(same) + ".")
    if around.actions is None:
        parts.append("The ROS context was shut down, so the graph cannot be asked.")
    elif not actions:
        parts.append("No action server at all is visible.")
    parts.append(
        f"Check that the server runs, and in the same domain (here ROS_DOMAIN_ID="
        f"{around.domain_id}, {around.middleware})."
    )
    return " ".join(parts)


def _listed(names: list[str], actions: dict[str, tuple[str, ...]] | None = None) -> str:
    shown = [
        repr(name) + (f" ({', '.join(actions[name])})" if actions else "") for name in names[:5]
    ]
    return ", ".join(shown) + (" and more" if len(names) > len(shown) else "")

"""What commands say of an action without a server."""

from __future__ import annotations

from typing import TYPE_CHECKING

from actionkit._model.similar_names import similar_names

if TYPE_CHECKING:
    from actionkit._ros.others_goals.survey import ActionSeen


def nothing_there(name: str, actions: dict[str, ActionSeen], *, doctor: bool = False) -> str:
    """Return sentences about an action without a server, with similar names.

    `doctor` means that `actionkit doctor` says so: it does not refer to itself.
    """
    served = [action.name for action in actions.values() if action.servers]
    near = similar_names(name, served)
    hint = f" Did you mean {' or '.join(near)}?" if near else ""
    more = "" if doctor else ", `actionkit doctor` more"
    more = "" if hint else f" `actionkit list` shows the actions in sight{more}."
    others = actions[name].only_publishing if name in actions else ()
    nodes = " and ".join(sorted({end.node for end in others if end.node}))
    only = f" Only its feedback is published, by {nodes}." if nodes else ""
    return f"Action {name!r} has no server in sight.{only}{hint}{more}"

"""Compares the versions of types on the graph with those that are installed here."""

from __future__ import annotations

from typing import TYPE_CHECKING

from actionkit._messages.by_name import interface_class

if TYPE_CHECKING:
    from actionkit._ros.others_goals.survey import ActionSeen, Survey


def not_ours(survey: Survey, action: ActionSeen) -> str:
    """Return the type hashes of what servers have in another version than is installed here.

    It is `""` if they have the same version, and if the type cannot be imported here.
    """
    if len(action.types) != 1 or not action.servers:
        return ""
    try:
        found = survey.versions_here(action.name, interface_class(action.types[0], "action"))
    except Exception:  # noqa: BLE001  of a broken package: other commands tell about that
        return ""
    return "; ".join(str(each) for each in found if each.differ)

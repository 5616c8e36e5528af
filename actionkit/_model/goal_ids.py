"""Checks the id of a goal that a user gives."""

from __future__ import annotations

import uuid

from actionkit._model.field_errors import shown


def goal_id_of(value: object) -> uuid.UUID:
    """Return the id of a goal, which may be given as text.

    Raises:
        TypeError: It is neither text nor a UUID.
        ValueError: It cannot be a goal's id.
    """
    if isinstance(value, uuid.UUID):
        goal_id = value
    elif isinstance(value, str):
        try:
            goal_id = uuid.UUID(value)
        except ValueError:
            raise ValueError(
                f"{shown(value)} is not a goal id, which has 32 hexadecimal digits, with dashes or"
                " without"
            ) from None
    else:
        raise TypeError(f"{shown(value)} must be the id of a goal: a uuid.UUID, or text")
    if not goal_id.int:
        raise ValueError(f"{goal_id} cannot be the id of a goal: servers take it for all goals")
    return goal_id

"""Decodes the fields of recorded goals, feedback and results, where the types were recorded."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Mapping
from typing import Any

_LINE = "=" * 80 + "\n"
"""Between two definitions; https://github.com/ros2/rosbag2, docs/message_definition_encoding.md."""
_MOST_ITEMS = 100
"""Elements of each array that are kept, as `JsonLines` does."""
_EVENT = "uint8 a\nint32 b\nuint32 c\nuint8[16] d\nint64 e\n"
"""The fields of `service_msgs/ServiceEventInfo`, before request and response."""
_WRAPPERS = {
    "Request": "uint8[16] goal_id\n{0}_Goal fields\n",
    "Response": "int8 status\n{0}_Result fields\n",
    "Accepted": "bool accepted\nint32 a\nuint32 b\n",
    "Asked": "uint8[16] goal_id\n",
    "Feedback_": "uint8[16] goal_id\n{0}_Feedback fields\n",
    "Goal_": _EVENT + "{0}_Request[<=1] request\n{0}_Accepted[<=1] response\n",
    "Result_": _EVENT + "{0}_Asked[<=1] request\n{0}_Response[<=1] response\n",
}
"""The messages around goal, result and feedback, with fields for which no other type is needed."""


class Fields:
    """Decodes messages; `definitions` may grow."""

    def __init__(self, definitions: Mapping[str, str]) -> None:
        self._definitions = definitions
        self._stores: dict[str, Any] = {}
        self.missing: set[str] = set()
        """Action types with fields that cannot be decoded."""

    def feedback(self, action_type: str, data: bytes) -> dict[str, Any] | None:
        """Return the fields of a feedback message."""
        message = self._decoded(action_type, "Feedback_", data)
        return None if message is None else _plain(message.fields)

    def goal(self, action_type: str, data: bytes) -> dict[str, Any] | None:
        """Return the fields of the goal in a service event of `send_goal`."""
        message = self._decoded(action_type, "Goal_", data)
        return _plain(message.request[0].fields) if message and message.request else None

    def result(self, action_type: str, data: bytes) -> dict[str, Any] | None:
        """Return the fields of the result in a service event of `get_result`."""
        message = self._decoded(action_type, "Result_", data)
        return _plain(message.response[0].fields) if message and message.response else None

    def _decoded(self, action_type: str, wrapper: str, data: bytes) -> Any:
        if action_type not in self._stores:
            self._stores[action_type] = self._store(action_type)
        try:
            return self._stores[action_type].deserialize_cdr(data, f"{action_type}_{wrapper}")
        except Exception:  # noqa: BLE001  no types, wrong types, or a message that is cut off
            self.missing.add(action_type)
            return None

    def _store(self, action_type: str) -> Any:
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore

        types: dict[str, Any] = {}
        for name, text in self._definitions.items():
            if name.startswith(action_type):
                types.update(_types(name, text))
        store = get_typestore(Stores.EMPTY)
        try:
            for name, text in _WRAPPERS.items():
                full = f"{action_type}_{name}"
                types.update(get_types_from_msg(text.format(action_type), full))
            store.register(types)
        except Exception:  # noqa: BLE001  definitions that were damaged
            return None
        return store


def _types(name: str, text: str) -> dict[str, Any]:
    """Return the types in a recorded definition, which is that of `name` and of what it uses."""
    from rosbags.typesys import get_types_from_idl, get_types_from_msg

    types: dict[str, Any] = {}
    for place, section in enumerate(text.split(_LINE)):
        head, _, body = section.partition("\n")
        kind, _, full = head.partition(": ")
        try:
            if kind == "ACTION":  # since Kilted
                parts = re.split(r"^---.*$", body, flags=re.MULTILINE)
                for part, what in zip(parts, ("Goal", "Result", "Feedback"), strict=True):
                    types.update(get_types_from_msg(part, f"{full}_{what}"))
            elif kind == "IDL":
                types.update(get_types_from_idl(body))
            elif kind == "MSG":
                types.update(get_types_from_msg(body, full))
            elif place == 0 and section.strip():
                types.update(get_types_from_msg(section, name))
        except Exception:  # noqa: BLE001  the others may be enough
            continue
    return types


def _plain(value: Any) -> Any:
    """Return a decoded message as plain data."""
    if dataclasses.is_dataclass(value):
        fields = [each for each in dataclasses.fields(value) if "ClassVar" not in str(each.type)]
        return {each.name: _plain(getattr(value, each.name)) for each in fields}
    if hasattr(value, "tolist"):  # an array of numpy
        return value[:_MOST_ITEMS].tolist()
    return [_plain(each) for each in value[:_MOST_ITEMS]] if isinstance(value, list) else value

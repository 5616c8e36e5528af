# Made by `actionkit stubs`, which overwrites it.
# fmt: off
# ruff: noqa

import action_msgs.msg as _action_msgs_msg
from collections.abc import Sequence as _Sequence
from typing import Any as _Any
from typing import ClassVar as _ClassVar

class GoalStatusArray:
    SLOT_TYPES: _ClassVar[tuple[_Any, ...]]
    @property
    def status_list(self) -> list[_action_msgs_msg.GoalStatus]:  # sequence<action_msgs/GoalStatus>
        """An array of goal statuses."""
    @status_list.setter
    def status_list(self, value: _Sequence[_action_msgs_msg.GoalStatus]) -> None: ...
    def __init__(
        self,
        *,
        status_list: _Sequence[_action_msgs_msg.GoalStatus] = ...,
        check_fields: bool = ...,
    ) -> None: ...
    @classmethod
    def get_fields_and_field_types(cls) -> dict[str, str]: ...
    __hash__: _ClassVar[None]  # type: ignore[assignment]

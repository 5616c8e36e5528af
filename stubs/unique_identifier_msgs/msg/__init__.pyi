from collections.abc import Sequence
from typing import Any, ClassVar

class UUID:
    SLOT_TYPES: ClassVar[tuple[Any, ...]]
    @property
    def uuid(self) -> Any: ...  # a numpy array
    @uuid.setter
    def uuid(self, value: Sequence[int]) -> None: ...
    def __init__(self, *, uuid: Sequence[int] = ..., check_fields: bool = ...) -> None: ...
    @classmethod
    def get_fields_and_field_types(cls) -> dict[str, str]: ...

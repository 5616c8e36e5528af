"""Some types of the packages in a folder, with what these need of the others."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

from actionkit._interfaces.dependencies import IMPLIED
from actionkit._interfaces.errors import BadSourceError
from actionkit._interfaces.interface_file import InterfaceFile
from actionkit._model.similar_names import similar_names

Read = Mapping[str, Sequence[InterfaceFile]]
"""The files of each package."""
_Key = tuple[str, str]
"""A package, and a type in it such as `action/Pick`."""


def select(read: Read, only: Collection[str]) -> dict[str, list[InterfaceFile]]:
    """Return the files of some types, and those of the messages that they use.

    Raises:
        BadSourceError: There is no such type.
    """
    known = _by_key(read)
    for name in only:
        if not any(name in (key[1], "/".join(key)) for key in known):
            near = similar_names(name, sorted({key[1] for key in known}), alike=0.7)
            hint = f"Did you mean {' or '.join(near)}?" if near else "Write KIND/NAME: action/Pick"
            raise BadSourceError(f"--only {name}: there is no such type here. {hint}")
    needed = _needed(known, [key for key in known if {key[1], "/".join(key)} & set(only)])
    chosen = {name: [f for f in files if _key(name, f) in needed] for name, files in read.items()}
    return {name: files for name, files in chosen.items() if files}


def without(read: Read, missing: Collection[str]) -> str | None:
    """Return a type that needs none of the missing packages, an action if there is one."""
    known = _by_key(read)
    for key in sorted(known, key=lambda key: (not key[1].startswith("action/"), key)):
        files = [known[one] for one in _needed(known, [key])]
        used = {use.package for file in files for use in file.uses}
        if not (used.union(*(IMPLIED[file.path.suffix[1:]] for file in files)) & set(missing)):
            return key[1]
    return None


def _by_key(read: Read) -> dict[_Key, InterfaceFile]:
    return {_key(name, file): file for name, files in read.items() for file in files}


def _key(package: str, file: InterfaceFile) -> _Key:
    return package, file.path.with_suffix("").as_posix()


def _needed(known: Mapping[_Key, InterfaceFile], keys: Sequence[_Key]) -> set[_Key]:
    left, needed = list(keys), set[_Key]()
    while left:
        key = left.pop()
        if key in known and key not in needed:
            needed.add(key)
            left += [(use.package, f"msg/{use.name}") for use in known[key].uses]
    return needed

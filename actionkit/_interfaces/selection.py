"""Selects some types of the packages in a folder, and the types that these need."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import replace

from actionkit._interfaces.errors import BadSourceError
from actionkit._interfaces.interface_file import InterfaceFile
from actionkit._interfaces.source_tree import Package
from actionkit._model.similar_names import similar_names


def select(packages: Mapping[str, Package], only: Iterable[str]) -> dict[str, Package]:
    """Return packages with only the named types and the messages that these use."""
    known = _by_type(packages)
    chosen: list[InterfaceFile] = []
    for name in only:
        found = [file for file in known.values() if name in (file.type_name, _short(file))]
        if not found:
            near = similar_names(name, sorted({_short(file) for file in known.values()}), alike=0.7)
            hint = f"Did you mean {' or '.join(near)}?" if near else "Write KIND/NAME: action/Pick"
            raise BadSourceError(f"--only {name}: there is no such type here. {hint}")
        chosen += found
    needed = _with_all_they_use(chosen, known)
    cut = {
        name: replace(package, files=tuple(file for file in package.files if file in needed))
        for name, package in packages.items()
    }
    return {name: package for name, package in cut.items() if package.files}


def without(packages: Mapping[str, Package], missing: Collection[str]) -> str | None:
    """Return a type that can be built without the missing packages, an action if possible."""
    known = _by_type(packages)
    for _, file in sorted(known.items(), key=lambda item: (item[1].kind != "action", item[0])):
        needed = _with_all_they_use([file], known)
        if not any(one.packages() & set(missing) for one in needed):
            return _short(file)
    return None


def _by_type(packages: Mapping[str, Package]) -> dict[str, InterfaceFile]:
    return {file.type_name: file for package in packages.values() for file in package.files}


def _short(file: InterfaceFile) -> str:
    return file.type_name.partition("/")[2]


def _with_all_they_use(
    files: Iterable[InterfaceFile], known: Mapping[str, InterfaceFile]
) -> list[InterfaceFile]:
    found = list(files)
    for file in found:  # grows during the loop
        used = [known.get(f"{use.package}/msg/{use.name}") for use in file.uses]
        found += [one for one in used if one is not None and one not in found]
    return found

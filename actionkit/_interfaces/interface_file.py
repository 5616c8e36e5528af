"""Reads a .msg, .srv or .action file and checks it line by line.

rosidl's parser says what is wrong, but not where. So it gets each line alone.
"""

from __future__ import annotations

import re
from codecs import BOM_UTF8
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from actionkit._interfaces import lines

PARTS = {
    "msg": ("message",),
    "srv": ("request", "response"),
    "action": ("goal", "result", "feedback"),
}
"""Kind (a folder of a package, and the ending of the files in it) -> the parts of a file."""
_SERVICE = {"builtin_interfaces", "service_msgs"}
_ACTION = _SERVICE | {"action_msgs", "unique_identifier_msgs"}
_IMPLIED: dict[str, set[str]] = {"msg": set(), "srv": _SERVICE, "action": _ACTION}
"""Kind -> the packages that its types use without naming them."""
_SEPARATOR = re.compile(r"\s*---\s*(#.*)?")
_FILE_NAME = re.compile(r"[A-Z][A-Za-z0-9]*")
_ODD_LINE_ENDS = re.compile("[\v\f\x1c-\x1e\x85\u2028\u2029]")
"""Characters that end a line for Python, but not for editors. In a comment they do not end it."""


@dataclass(frozen=True)
class Use:
    """A message type that a line uses."""

    package: str
    name: str
    place: str


@dataclass(eq=False)
class InterfaceFile:
    """A checked file, with its mistakes, and notes on what only colcon would refuse."""

    package: str
    path: Path  # relative to the package
    text: str = ""  # what the generators may read: plain line ends, no byte order mark
    uses: list[Use] = field(default_factory=list)
    problems: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    @property
    def kind(self) -> str:
        return self.path.suffix[1:]

    @property
    def type_name(self) -> str:
        """Such as `pick_interfaces/action/Pick`."""
        return f"{self.package}/{self.kind}/{self.path.stem}"

    def packages(self) -> set[str]:
        """Return the packages with types that the file uses."""
        return {use.package for use in self.uses} | _IMPLIED[self.kind]


def read(package: str, folder: Path, path: Path) -> InterfaceFile:
    """Read and check a file."""
    file, shown, parts = InterfaceFile(package, path), folder / path, PARTS[path.suffix[1:]]
    data = shown.read_bytes()
    if data.startswith(BOM_UTF8):
        file.notes.append(f"{shown}:1: save it as UTF-8 without a byte order mark (BOM)")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        before = data[: error.start].count(b"\n")
        file.problems.append(f"{shown}:{before + 1}: this is not UTF-8: save it as UTF-8")
        return file
    if not _FILE_NAME.fullmatch(path.stem):
        file.problems.append(
            f"{shown}: the file's name is the type's: begin it with a capital letter, and use"
            f" letters and digits only, as {_proposed_name(path.stem)}{path.suffix}"
        )
    written = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    plain = [_plain(_ODD_LINE_ENDS.sub(" ", line)) for line in written]
    file.text = "\n".join(plain)
    lines_of: list[dict[str, int]] = [{}]  # for each part of the file: name -> line
    for number, (raw, line) in enumerate(zip(written, plain, strict=True), 1):
        place = f"{shown}:{number}"
        if (note := _note(raw, line)) is not None:
            file.notes.append(f"{place}: {note}")
        if line == "---":
            lines_of.append({})
            if len(lines_of) == len(parts) + 1:
                file.problems.append(f"{place}: one line `---` too many: {_form(file.kind)}")
            continue
        try:
            found = lines.check(package, line)
        except lines.BadLineError as error:
            file.problems.append(f"{place}: {error}")
            continue
        for name in (one.name for one in [*found.fields, *found.constants]):
            if (first := lines_of[-1].setdefault(name, number)) != number:
                file.problems.append(
                    f"{place}: the name {name!r} is taken already, by line {first}"
                )
        types = [one.type for one in found.fields if not one.type.is_primitive_type()]
        file.uses += [Use(one.pkg_name, one.type, place) for one in types]
    if len(lines_of) < len(parts) and not any("line `---`" in each for each in file.problems):
        last = max(1, len(file.text.rstrip().split("\n")))
        lacking = parts[len(lines_of)]
        file.problems.append(f"{shown}:{last}: the {lacking} is missing: {_form(file.kind)}")
    if not file.problems:
        file.problems += _equal_constants(file, shown, lines_of)
    return file


def _plain(line: str) -> str:
    """Return the line in a form that rosidl's parser accepts: no odd spaces, no `--- # result`.

    An indented comment stays indented: it belongs to the line above it.
    """
    if _SEPARATOR.fullmatch(line):
        return "---"
    return line.rstrip() if line.lstrip().startswith("#") else line.strip()


def _note(raw: str, line: str) -> str | None:
    """Return what colcon would refuse in a line that we accept; `None` if nothing."""
    if line == "---" != raw:
        return "write `---` alone, without spaces or a comment"
    if raw.rstrip() == line:
        return None
    odd = "the control character" if _ODD_LINE_ENDS.search(raw) else "the space before it"
    return f"remove {odd}"


def _form(kind: str) -> str:
    parts = PARTS[kind]
    several = f"{len(parts)} parts, the {', the '.join(parts)}, with a line `---` between them"
    return f"a .{kind} file has {several if len(parts) > 1 else 'one part'}"


def _equal_constants(
    file: InterfaceFile, shown: Path, lines_of: Sequence[Mapping[str, int]]
) -> Iterator[str]:
    """Refuse equal constants in two parts: rosidl's parser puts both into the first one."""
    seen: dict[str, tuple[str, int]] = {}
    texts = re.split(r"^---\n?", file.text, flags=re.M)
    for part, text, line_of in zip(PARTS[file.kind], texts, lines_of, strict=True):
        for one in lines.parse(file.package, text).constants:
            line, comments = line_of[one.name], one.annotations.get("comment")
            key = str((one.type, one.name, one.value, comments))
            other, first = seen.setdefault(key, (part, line))
            if other != part:
                yield (
                    f"{shown}:{line}: {one.name} is the same as that of the {other} (line {first}),"
                    " and ROS takes both for one: rename one, or add a comment to this line"
                )


def _proposed_name(stem: str) -> str:
    name = "".join(word[:1].upper() + word[1:] for word in re.split(r"[^A-Za-z0-9]+", stem))
    return name if _FILE_NAME.fullmatch(name) else "Pick"

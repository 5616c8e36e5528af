"""One .msg, .srv or .action file: its text, checked line by line.

rosidl's parser says what is wrong, but not where; so it is asked about each line alone.
"""

from __future__ import annotations

import contextlib
import importlib
import io
import math
import re
from codecs import BOM_UTF8
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from actionkit._interfaces.field_names import problem_with

PARTS = {
    "msg": ("message",),
    "srv": ("request", "response"),
    "action": ("goal", "result", "feedback"),
}
_SEPARATOR = re.compile(r"\s*---\s*(#.*)?")
_ALMOST_SEPARATOR = re.compile(r"\s*-+\s*(#.*)?")
_SPLIT = re.compile(r"^---\n?", re.M)
_ESCAPE_IN_COMMENT = re.compile(r"\\([nrxuUN0-7]\w*|$)")
"""What the grammar of .idl files, into which comments are copied, takes for a character."""
_ESCAPE_IN_TEXT = re.compile(r"\\(?!['\"t])|\\.?$")
_DEFAULT_WITH_EQUALS = re.compile(r"(\S+)\s+([a-z]\w*)\s*=\s*(.*)")
_FILE_NAME = re.compile(r"[A-Z][A-Za-z0-9]*")
_ODD_LINE_ENDS = re.compile("[\v\f\x1c-\x1e\x85\u2028\u2029]")
"""What Python takes for the end of a line besides those of editors; in a comment, it is none."""
_OTHER_LANGUAGES = {
    "int": "int32", "long": "int64", "short": "int16", "float": "float32", "double": "float64",
    "str": "string", "boolean": "bool", "time": "builtin_interfaces/Time",
    "duration": "builtin_interfaces/Duration", "Header": "std_msgs/Header",
    "Time": "builtin_interfaces/Time", "Duration": "builtin_interfaces/Duration",
}  # fmt: skip


@dataclass(frozen=True)
class Use:
    """A message type that a line uses."""

    package: str
    name: str
    place: str


@dataclass
class InterfaceFile:
    """A checked file.

    Attributes:
        path: Relative to its package.
        text: What the generators may read: plain line ends, no byte order mark.
        uses: The message types of its fields.
        problems: What is wrong, each with file and line; nothing can be built while there is one.
        notes: What colcon would refuse, though it is built here, each with file and line.
    """

    path: Path
    text: str
    uses: list[Use] = field(default_factory=list)
    problems: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


def read(package: str, folder: Path, path: Path) -> InterfaceFile:
    """Read and check a file."""
    shown = folder / path
    try:
        text = (folder / path).read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = error.object[: error.start].count(b"\n") + 1
        return InterfaceFile(path, "", [], [f"{shown}:{line}: this is not UTF-8: save it as UTF-8"])
    except OSError as error:
        return InterfaceFile(path, "", [], [f"{shown}: {error.strerror}"])
    written = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    lines = [_plain(_ODD_LINE_ENDS.sub(" ", line)) for line in written]
    file = InterfaceFile(path, "\n".join(lines))
    if (folder / path).read_bytes().startswith(BOM_UTF8):
        file.notes.append(f"{shown}:1: save it as UTF-8 without a byte order mark (BOM)")
    for number, (raw, plain) in enumerate(zip(written, lines, strict=True), 1):
        if plain == "---" != raw:
            file.notes.append(f"{shown}:{number}: write `---` alone, without spaces or a comment")
        elif raw.rstrip() != plain:
            odd = "the control character" if _ODD_LINE_ENDS.search(raw) else "the space before it"
            file.notes.append(f"{shown}:{number}: remove {odd}")
    if not _FILE_NAME.fullmatch(path.stem):
        file.problems.append(
            f"{shown}: the file's name is the type's: begin it with a capital letter, and use"
            f" letters and digits only, as {_proposed_name(path.stem)}{path.suffix}"
        )
        return file
    _check(file, package, shown, lines)
    return file


def _plain(line: str) -> str:
    """Return the line as rosidl's parser takes it, which stumbles over spaces and `--- # result`.

    An indented comment stays indented: it belongs to the line above it.
    """
    if _SEPARATOR.fullmatch(line):
        return "---"
    return line.rstrip() if line.lstrip().startswith("#") else line.strip()


def _check(file: InterfaceFile, package: str, shown: Path, lines: list[str]) -> None:
    kind = file.path.suffix[1:]
    parts = PARTS[kind]
    part, seen = 0, dict[str, int]()
    numbers = [seen]
    for number, line in enumerate(lines, 1):
        place = f"{shown}:{number}"
        if line == "---":
            part, seen = part + 1, {}
            numbers.append(seen)
            if part == len(parts):
                file.problems.append(
                    f"{place}: one line `---` too many: {_form(kind, shown.suffix)}"
                )
        elif _ALMOST_SEPARATOR.fullmatch(line):
            file.problems.append(f"{place}: {line.strip()!r}: parts are parted by a line `---`")
        else:
            for problem in _check_line(file, package, place, line, number, seen):
                file.problems.append(f"{place}: {problem}")
    if part + 1 < len(parts):
        last = max(1, len(file.text.rstrip().split("\n")))
        file.problems.append(
            f"{shown}:{last}: the {parts[part + 1]} is missing: {_form(kind, shown.suffix)}"
        )
    if not file.problems:
        _check_constants(file, package, shown, parts, numbers)


def _check_constants(
    file: InterfaceFile,
    package: str,
    shown: Path,
    parts: Sequence[str],
    numbers: Sequence[Mapping[str, int]],
) -> None:
    """Refuse equal constants in two parts: rosidl's parser gives both to the first one."""
    parser: Any = importlib.import_module("rosidl_adapter.parser")
    seen: dict[tuple[str, ...], tuple[str, int]] = {}
    for part, text, lines in zip(parts, _SPLIT.split(file.text), numbers, strict=True):
        for one in parser.parse_message_string(package, "Part", text).constants:
            comments = one.annotations.get("comment", ())
            key = (one.type, one.name, str(one.value), *comments)
            other, line = seen.setdefault(key, (part, lines[one.name]))
            if other != part:
                file.problems.append(
                    f"{shown}:{lines[one.name]}: {one.name} is the same as that of the {other}"
                    f" (line {line}), and ROS takes both for one: rename one, or write a comment"
                    " behind it"
                )


def _form(kind: str, suffix: str) -> str:
    parts = PARTS[kind]
    if len(parts) == 1:
        return f"a {suffix} file has one part"
    names = ", ".join(f"the {name}" for name in parts)
    return f"a {suffix} file has {len(parts)} parts, {names}, with a line `---` between them"


def _check_line(
    file: InterfaceFile, package: str, place: str, line: str, number: int, seen: dict[str, int]
) -> Iterator[str]:
    parser: Any = importlib.import_module("rosidl_adapter.parser")

    code, _, comment = line.partition("#")
    code = code.strip()
    if (odd := _ESCAPE_IN_COMMENT.search(comment)) is not None:
        yield (
            f"{odd[0]!s} in a comment: ROS takes the backslash for the begin of a special"
            " character: write / for it"
        )
    if not code:
        return
    # The parser writes to standard error as well.
    with contextlib.redirect_stderr(io.StringIO()):
        try:
            found = parser.parse_message_string(package, "Line", line)
        except Exception as error:  # noqa: BLE001  it raises whatever comes to hand
            yield _explained(code, error)
            return
    for one in [*found.fields, *found.constants]:
        if (problem := _problem_with_value(one, code)) is not None:
            yield problem
        first = seen.setdefault(one.name, number)
        if first != number:
            yield f"the name {one.name!r} is taken already, by line {first}"
    for one in found.fields:
        if (problem := problem_with(one.name)) is not None:
            yield problem
        if one.type.type in ("time", "duration"):  # which the parser takes, and no generator
            yield _unknown_type(one.type.type)
        elif not one.type.is_primitive_type():
            file.uses.append(Use(one.type.pkg_name, one.type.type, place))


def _problem_with_value(one: Any, code: str) -> str | None:
    """Return why no generator can write a default, or the value of a constant."""
    value = getattr(one, "value", None) if hasattr(one, "value") else one.default_value
    values = value if isinstance(value, list) else [value]
    if any(isinstance(each, float) and not math.isfinite(each) for each in values):
        return f"{code!r}: only finite numbers can be written here"
    if not values and not one.type.type.endswith("string"):
        return f"{code!r}: leave [] out: a list is empty by itself"
    if any(isinstance(each, str) for each in values) and _ESCAPE_IN_TEXT.search(code):
        return f"{code!r}: a text can have no backslash, except before a quote"
    return None


def _explained(code: str, error: Exception) -> str:
    words = code.split(None, 1)
    base = re.sub(r"(<=\d+)?(\[.*)?$", "", words[0])
    if len(words) == 1:
        return f"{code!r}: a line has a type and a name, as `float64 distance`"
    if re.fullmatch(r"\w+/(msg|srv|action)/\w+", base):
        package, _, name = base.split("/")
        return f"{code!r}: write {package}/{name}, without the folder"
    if (match := _DEFAULT_WITH_EQUALS.fullmatch(code)) is not None:
        return (
            f"{code!r}: a default is written without `=`, as `{' '.join(match.groups())}`; and the"
            " name of a constant has capital letters only"
        )
    if base in _OTHER_LANGUAGES and "/" not in base and base[0].islower():
        return _unknown_type(base)
    return f"{code!r}: {str(error) or type(error).__name__}"


def _unknown_type(name: str) -> str:
    return f"there is no type {name!r}: use {_OTHER_LANGUAGES[name]}"


def another_type(name: str) -> str | None:
    """Return the type that is probably meant by a name of no type of ROS."""
    return _OTHER_LANGUAGES.get(name)


def _proposed_name(stem: str) -> str:
    name = "".join(word[:1].upper() + word[1:] for word in re.split(r"[^A-Za-z0-9]+", stem))
    return name if _FILE_NAME.fullmatch(name) else "Pick"

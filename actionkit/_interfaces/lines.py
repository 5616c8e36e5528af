"""Parses and checks one line of a .msg, .srv or .action file."""

from __future__ import annotations

import contextlib
import importlib
import io
import keyword
import math
import re
from typing import Any

OTHER_LANGUAGES = {
    "int": "int32", "long": "int64", "short": "int16", "float": "float32", "double": "float64",
    "str": "string", "std::string": "string", "boolean": "bool", "time": "builtin_interfaces/Time",
    "duration": "builtin_interfaces/Duration", "Header": "std_msgs/Header",
    "Time": "builtin_interfaces/Time", "Duration": "builtin_interfaces/Duration",
}  # fmt: skip
"""Type names of other languages -> the type of ROS that is probably meant."""
_C_AND_CPP = re.findall(
    r"\w+",
    "alignas alignof and_eq asm auto bitand bitor bool break case catch char char16_t char32_t"
    " class co_await co_return co_yield compl concept const const_cast consteval constexpr"
    " constinit continue decltype default delete do double dynamic_cast else enum errno explicit"
    " export extern false float for friend goto if inline int long mutable namespace new noexcept"
    " not_eq nullptr operator or_eq private protected public register reinterpret_cast requires"
    " restrict return short signed sizeof static static_assert static_cast struct switch template"
    " this thread_local throw true try typedef typeid typename union unsigned using virtual void"
    " volatile wchar_t while xor xor_eq",
)
_RESERVED = {
    "Python": keyword.kwlist,
    "C or C++": _C_AND_CPP,
    # The generated class uses it in its body, and would find the field first.
    "the generated Python code": ["builtins"],
}
"""Language -> words that cannot be the name of a field."""
_ESCAPE_IN_COMMENT = re.compile(r"\\([nrxuUN0-7]\w*|$)")
"""Escapes in a comment. Comments are copied into .idl files, where these are characters."""
_ESCAPE_IN_TEXT = re.compile(r"\\(?!['\"t])|\\.?$")


class BadLineError(Exception):
    """A line is not valid; the text says why, and what to write."""


def check(package: str, line: str) -> Any:
    """Return the fields and constants of a line, or raise a `BadLineError`."""
    code, _, comment = line.partition("#")
    code = code.strip()
    if (odd := _ESCAPE_IN_COMMENT.search(comment)) is not None:
        raise BadLineError(
            f"{odd[0]} in a comment: for ROS, a special character begins with the backslash:"
            " write / in its place"
        )
    if code and not code.strip("-"):
        raise BadLineError(f"{code!r}: separate the parts with a line `---`")
    try:
        found = parse(package, line)
    except Exception as error:  # noqa: BLE001  it raises errors of many kinds
        raise BadLineError(_explained(code, error)) from None
    problems = [_problem_with_value(one, code) for one in [*found.fields, *found.constants]]
    problems += [_problem_with_name(one.name) for one in found.fields]
    for type_name in (one.type.type for one in found.fields):
        if type_name in ("time", "duration"):  # the parser accepts them, the generators do not
            problems.append(_unknown_type(type_name))
    for problem in filter(None, problems):
        raise BadLineError(problem)
    return found


def parse(package: str, text: str) -> Any:
    """Return the fields and constants of a part of a file, or of a line alone."""
    parser: Any = importlib.import_module("rosidl_adapter.parser")
    with contextlib.redirect_stderr(io.StringIO()):  # it raises the same text
        return parser.parse_message_string(package, "Part", text)


def _problem_with_value(one: Any, code: str) -> str | None:
    """Return what is wrong with a default or a constant's value; `None` if nothing."""
    value = one.value if hasattr(one, "value") else one.default_value
    values = value if isinstance(value, list) else [value]
    if any(isinstance(each, float) and not math.isfinite(each) for each in values):
        return f"{code!r}: only finite numbers can be written: leave it out, and set it later"
    if not values and not one.type.type.endswith("string"):
        return f"{code!r}: leave [] out: a list is empty by itself"
    if any(isinstance(each, str) for each in values) and _ESCAPE_IN_TEXT.search(code):
        return f"{code!r}: a text can have no backslash, except before a quote"
    return None


def _problem_with_name(name: str) -> str | None:
    """Return what is wrong with the name of a field; `None` if nothing."""
    for language in (one for one, words in _RESERVED.items() if name in words):
        return f"{name!r} is a word of {language}, which ROS generates from this: use {name}_value"
    return None


def _explained(code: str, error: Exception) -> str:
    words = code.split(None, 1)
    base = re.sub(r"(<=\d+)?(\[.*)?$", "", words[0])
    if len(words) == 1:
        return f"{code!r}: a line has a type and a name, as `float64 distance`"
    if (match := re.fullmatch(r"(\w+)/(?:msg|srv|action)/(\w+)", base)) is not None:
        return f"{code!r}: write {'/'.join(match.groups())}, without the folder"
    if (match := re.fullmatch(r"(\S+)\s+([a-z]\w*)\s*=\s*(.*)", code)) is not None:
        return (
            f"{code!r}: a default is written without `=`, as `{' '.join(match.groups())}`; a"
            f" constant has capital letters, as `{match[1]} {match[2].upper()}={match[3]}`"
        )
    if base in OTHER_LANGUAGES and base[0].islower():
        return _unknown_type(base)
    if "invalid field name" in str(error):  # regular expressions follow
        parts = re.findall("[A-Z]?[a-z0-9]+|[A-Z]+(?![a-z])", words[1].split()[0])
        near = "_".join(parts).lower().lstrip("_0123456789") or "value"
        near += "_value" if _problem_with_name(near) else ""
        return f"{code!r}: names have small letters, digits and single underscores, as {near}"
    if "invalid message name" in str(error):
        return f"{code!r}: no type {words[0]!r}: write a line as `float64 x` or `float64[] xs`"
    return f"{code!r}: {str(error) or type(error).__name__}"


def _unknown_type(name: str) -> str:
    return f"there is no type {name!r}: use {OTHER_LANGUAGES[name]}"

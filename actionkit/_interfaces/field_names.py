"""Names of fields that a generator cannot write down: words of Python, C and C++."""

from __future__ import annotations

import keyword
import re

_C_AND_CPP = frozenset(
    re.findall(
        r"\w+",
        "alignas alignof and_eq asm auto bitand bitor bool break case catch char char16_t char32_t"
        " class co_await co_return co_yield compl concept const const_cast consteval constexpr"
        " constinit continue decltype default delete do double dynamic_cast else enum explicit"
        " errno export extern false float for friend goto if inline int long mutable namespace new"
        " noexcept not_eq nullptr operator or_eq private protected public register"
        " reinterpret_cast requires restrict return short signed sizeof static static_assert"
        " static_cast struct switch template this thread_local throw true try typedef typeid"
        " typename union unsigned using virtual void volatile wchar_t while xor xor_eq",
    )
)


def problem_with(field: str) -> str | None:
    """Return why no field can be called so, with another name to take; `None` if one can."""
    if keyword.iskeyword(field):
        language = "Python"
    elif field in _C_AND_CPP:
        language = "C or C++"
    elif field == "builtins":
        # The generated class uses it in its body, where the field would be found first.
        language = "the generated Python code"
    else:
        return None
    return f"{field!r} is a word of {language}, which ROS generates from this: use {field}_value"

"""Checked conversion of single field values: scalars, strings, bytes and arrays of them.

ROS messages do not check what is assigned to them (their `check_fields` is off by default), and
their C conversion trusts what it finds: a wrong number is cut to its width, a wrong array length
is read past its end. So every value is checked here, before it gets into a message.

Each function makes a converter, once per message class; a converter takes one value of the user's
and returns a new, valid one. Errors carry a path relative to the converted value; the converter of
the value around it prepends its own part, so that the good case pays nothing for paths.
"""

from __future__ import annotations

import sys
from array import array
from collections.abc import Callable, Iterable, Sequence
from numbers import Integral, Real
from typing import Any

from actionkit._model.field_errors import FieldError, FieldProblem, shown, wrong_type

Converter = Callable[[Any], Any]

_FLOAT32_MAX = 3.4028234663852886e38
_INFINITY = float("inf")

# ROS type name -> typecode of the `array.array` that holds it, which numpy calls by the same name.
_INTEGER_CODES = {
    "int8": "b",
    "uint8": "B",  # also the `char` of .msg files: Jazzy maps it to uint8
    "int16": "h",
    "uint16": "H",
    "int32": "i",
    "uint32": "I",
    "int64": "q",
    "uint64": "Q",
}
_FLOAT_CODES = {"float": "f", "double": "d"}
NUMERIC_CODES = {**_INTEGER_CODES, **_FLOAT_CODES}


def integer(ros_type: str) -> Converter:
    """Make the converter for an integer type, by name: `int8` to `uint64`."""
    bits = int(ros_type.lstrip("uint"))
    low = 0 if ros_type[0] == "u" else -(2 ** (bits - 1))
    high = low + 2**bits - 1

    def convert(value: Any) -> int:
        if type(value) is not int:
            # numpy's integers are `Integral`; its bool is not, Python's is
            if not isinstance(value, Integral) or isinstance(value, bool):
                raise wrong_type(value, ros_type, "an int")
            value = int(value)
        if low <= value <= high:
            return value  # type: ignore[no-any-return]
        problem = f"{shown(value)} is out of range for {ros_type} ({low}..{high})"
        raise FieldError("", value, problem)

    return convert


def floating(ros_type: str) -> Converter:
    """Make the converter for `float` (32 bits) or `double`. nan and the infinities are fine."""
    limit = _FLOAT32_MAX if ros_type == "float" else sys.float_info.max

    def convert(value: Any) -> float:
        given = value
        if type(value) is not float:
            if not isinstance(value, Real) or isinstance(value, bool):
                raise wrong_type(value, ros_type, "a float or an int")
            try:
                value = float(value)
            except OverflowError:  # an int of more than 308 digits
                raise _too_large(given, ros_type, limit) from None
        # A value beyond the limit that is not an infinity would silently become one; nan passes.
        if (value > limit or value < -limit) and value not in (_INFINITY, -_INFINITY):
            raise _too_large(given, ros_type, limit)
        return value  # type: ignore[no-any-return]

    return convert


def _too_large(value: object, ros_type: str, limit: float) -> FieldError:
    return FieldError(
        "", value, f"{shown(value)} is out of range for {ros_type} (-{limit:.9g}..{limit:.9g})"
    )


def boolean(value: Any) -> bool:
    """Convert a bool, Python's or numpy's; an int is none."""
    if type(value) is bool:
        return value
    numpy = sys.modules.get("numpy")
    if numpy is not None and isinstance(value, numpy.bool_):
        return bool(value)
    raise wrong_type(value, "boolean", "a bool (True or False)")


def octet(value: Any) -> bytes:
    """Convert a `byte`: one byte as bytes, which is ROS's form of it, or an int 0..255."""
    if isinstance(value, (bytes, bytearray)):
        if len(value) == 1:
            return bytes(value)
        problem = f"{shown(value)} has {len(value)} bytes, but octet needs exactly one"
        raise FieldError("", value, problem)
    if not isinstance(value, Integral) or isinstance(value, bool):
        raise wrong_type(value, "octet", "bytes of length 1 or an int 0..255")
    number = int(value)
    if 0 <= number <= 255:
        return bytes((number,))
    raise FieldError("", value, f"{shown(value)} is out of range for octet (0..255)")


def string(limit: int | None, wide: bool) -> Converter:
    """Make the converter for a string type.

    Args:
        limit: The bound of a bounded string, or None. It counts what travels: bytes of UTF-8, or
            16-bit units of a wide string. (The generated Python counts characters, but the
            middleware sizes its buffers by the bound.)
        wide: Whether it is a `wstring`.
    """
    name = "wstring" if wide else "string"
    ros_type = name if limit is None else f"{name}<{limit}>"
    encoding, width = ("utf-16-le", 2) if wide else ("utf-8", 1)

    def convert(value: Any) -> str:
        if type(value) is not str:
            if not isinstance(value, str):
                raise wrong_type(value, ros_type, "a str")
            value = str.__str__(value)  # plain, out of a subclass such as an enumeration's
        # The C side ends a string at its first NUL, and the rest would be lost without a word. A
        # wide string is carried by its length, NULs and all.
        if not wide and "\0" in value:
            problem = f"{shown(value)} holds a NUL character, which {ros_type} cannot; remove it"
            raise FieldError("", value, problem)
        if limit is None and value.isascii():
            return value  # type: ignore[no-any-return]
        try:
            size = len(value.encode(encoding)) // width
        except UnicodeEncodeError as error:
            problem = (
                f"{shown(value)} holds a lone surrogate at index {error.start}, "
                f"which {ros_type} cannot; remove it"
            )
            raise FieldError("", value, problem) from None
        if limit is not None and size > limit:
            unit = "16-bit units" if wide else "bytes of UTF-8"
            problem = f"{shown(value)} has {size} {unit}, but {ros_type} takes at most {limit}"
            raise FieldError("", value, problem)
        return value  # type: ignore[no-any-return]

    return convert


def unchecked(value: Any) -> Any:
    """Pass on a scalar of an IDL type that .msg files do not know (`wchar`, `long double`)."""
    if value is None:
        raise wrong_type(value, "this field", "a value")
    return value


def numbers(ros_type: str) -> Callable[[Any], array[Any]]:
    """Make the converter for a sequence of numbers, to `array.array`.

    Arrays of the right element type are copied without looking at elements; lists are checked and
    converted in C, and only walked through in Python to find out which element is wrong.
    """
    code = NUMERIC_CODES[ros_type]
    element = integer(ros_type) if ros_type in _INTEGER_CODES else floating(ros_type)
    exact = {int} if ros_type in _INTEGER_CODES else {int, float}
    kind = "f" if code in "fd" else "u" if code.isupper() else "i"
    width = array(code).itemsize

    def convert(value: Any) -> array[Any]:
        if isinstance(value, array):
            if value.typecode == code:
                return value[:]
        elif _is_vector(value):
            dtype: Any = value.dtype
            if dtype.kind == kind and dtype.itemsize == width and dtype.isnative:
                return array(code, value.tobytes())
        elif code == "B" and isinstance(value, (bytes, bytearray)):
            return array(code, value)
        items = items_of(value, f"a sequence of {ros_type}")
        if exact.issuperset(map(type, items)):  # so no bools, which `array` would take for 0 and 1
            try:
                result = array(code, items)
            except OverflowError:
                pass  # found again below, with its index
            else:
                # array("f") turns what is too large into inf without a word
                if code != "f" or (_INFINITY not in result and -_INFINITY not in result):
                    return result
        return array(code, each(element, items))

    return convert


def booleans(value: Any) -> list[bool]:
    """Convert a sequence of bools."""
    return each(boolean, items_of(value, "a sequence of boolean"))


def octets(value: Any) -> list[bytes]:
    """Convert a sequence of `byte`, given one by one or as one `bytes`."""
    if isinstance(value, (bytes, bytearray)):
        return [bytes((number,)) for number in value]
    return each(octet, items_of(value, "a sequence of octet"))


def items_of(value: Any, ros_type: str) -> Sequence[Any]:
    """Return the elements of a list-like value, a numpy array as a list of Python's own types.

    Args:
        value: Anything of the user's.
        ros_type: What is asked for, in words, for the error.

    Raises:
        FieldTypeError: It is not list-like. A str, a mapping, a set and an iterator are not: the
            first two are nearly always mistakes, the others have no order or no length.
        FieldError: It is a numpy array of other than one dimension.
    """
    if isinstance(value, (list, tuple, array)):
        return value
    if _is_vector(value):
        return value.tolist()  # type: ignore[no-any-return]
    if isinstance(value, Sequence) and not isinstance(value, (str, bytes, bytearray, memoryview)):
        return list(value)
    raise wrong_type(value, ros_type, "a list, a tuple or an array")


def _is_vector(value: Any) -> bool:
    """Tell whether a value is a numpy array; raises FieldError where it is not a flat one."""
    numpy = sys.modules.get("numpy")  # who has an array has numpy loaded; we need not load it
    if numpy is None or not isinstance(value, numpy.ndarray):
        return False
    if value.ndim == 1:
        return True
    shape = "x".join(map(str, value.shape)) or "0-dimensional"
    problem = f"{shown(value)} is a {shape} array; ROS arrays are flat, give value.ravel()"
    raise FieldError("", value, problem)


def each(convert: Converter, items: Iterable[Any]) -> list[Any]:
    """Convert elements one by one; an error names the index of the element."""
    result = []
    for index, item in enumerate(items):
        try:
            result.append(convert(item))
        except FieldProblem as problem:
            problem.add_parent(f"[{index}]")
            raise
    return result

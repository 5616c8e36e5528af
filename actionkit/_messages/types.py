"""Checks and converts single field values: scalars, strings, bytes and arrays of them.

ROS messages do not check their values (`check_fields` is off by default), and their conversion in C
does not either: it cuts off the high bits of a number that is too large, and reads past the end of
an array that is too short. So every value is checked here, before it gets into a message.

Each function makes a converter, once for each message class. A converter takes one value from the
user and returns a new, valid one. The path in an error is relative to the converted value; the
converter of the outer value prepends its own part. So paths cost nothing while there is no error.
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

# ROS type name (numpy's name, too) -> typecode of the `array.array` that holds it.
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
            # numpy's integers are `Integral`. Its bool is not, but Python's bool is
            if not isinstance(value, Integral) or isinstance(value, bool):
                raise wrong_type(value, ros_type, "an int")
            value = int(value)
        if low <= value <= high:
            return value  # type: ignore[no-any-return]
        problem = f"{shown(value)} is out of range for {ros_type} ({low}..{high})"
        raise FieldError("", value, problem)

    return convert


def floating(ros_type: str) -> Converter:
    """Make the converter for `float` (32 bits) or `double`. nan and the infinities are allowed."""
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
        # A finite value beyond the limit would silently become an infinity. nan passes.
        if (value > limit or value < -limit) and value not in (_INFINITY, -_INFINITY):
            raise _too_large(given, ros_type, limit)
        return value  # type: ignore[no-any-return]

    return convert


def _too_large(value: object, ros_type: str, limit: float) -> FieldError:
    return FieldError(
        "", value, f"{shown(value)} is out of range for {ros_type} (-{limit:.9g}..{limit:.9g})"
    )


def boolean(value: Any) -> bool:
    """Convert a bool of Python or numpy; an int is refused."""
    if type(value) is bool:
        return value
    numpy = sys.modules.get("numpy")
    if numpy is not None and isinstance(value, numpy.bool_):
        return bool(value)
    raise wrong_type(value, "boolean", "a bool (True or False)")


def octet(value: Any) -> bytes:
    """Convert a `byte`: bytes of length 1 (ROS's own form), or an int 0..255."""
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
    """Make the converter for `string` or, if `wide`, `wstring`.

    The limit counts bytes of UTF-8, or the 16-bit units of a wide string; `None` means no limit.
    (The generated Python counts characters, but the middleware sizes its buffers by the limit.)
    """
    name = "wstring" if wide else "string"
    ros_type = name if limit is None else f"{name}<{limit}>"
    encoding, width = ("utf-16-le", 2) if wide else ("utf-8", 1)

    def convert(value: Any) -> str:
        if type(value) is not str:
            if not isinstance(value, str):
                raise wrong_type(value, ros_type, "a str")
            value = str.__str__(value)  # a plain str also from a subclass, such as an enumeration
        # The C side ends a string at its first NUL: the rest would be lost without an error. A wide
        # string has a length, so it may contain NULs.
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
    """Return a scalar of an IDL type that .msg files do not have (`wchar`, `long double`)."""
    if value is None:
        raise wrong_type(value, "this field", "a value")
    return value


def numbers(ros_type: str) -> Callable[[Any], array[Any]]:
    """Make the converter for a sequence of numbers, to `array.array`.

    Arrays of the right element type are copied as a whole. Lists are checked and converted in C;
    Python looks at each element only to find a wrong one.
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
        if exact.issuperset(map(type, items)):  # not bools: `array` would accept them
            try:
                result = array(code, items)
            except OverflowError:
                pass  # the error is found again below, with its index
            else:
                # array("f") silently turns a value that is too large into inf
                if code != "f" or (_INFINITY not in result and -_INFINITY not in result):
                    return result
        return array(code, each(element, items))

    return convert


def booleans(value: Any) -> list[bool]:
    """Convert a sequence of bools."""
    return each(boolean, items_of(value, "a sequence of boolean"))


def octets(value: Any) -> list[bytes]:
    """Convert a sequence of `byte`: a list of them, or one `bytes`."""
    if isinstance(value, (bytes, bytearray)):
        return [bytes((number,)) for number in value]
    return each(octet, items_of(value, "a sequence of octet"))


def items_of(value: Any, ros_type: str) -> Sequence[Any]:
    """Return the elements of a list-like value, a numpy array as a list of Python's own types.

    `ros_type` is for the error.

    Raises:
        FieldTypeError: It is not list-like. A str and a mapping are refused because they are nearly
            always mistakes; a set has no order, and an iterator has no length.
        FieldError: It is a numpy array with more or less than one dimension.
    """
    if isinstance(value, (list, tuple, array)):
        return value
    if _is_vector(value):
        return value.tolist()  # type: ignore[no-any-return]
    if isinstance(value, Sequence) and not isinstance(value, (str, bytes, bytearray, memoryview)):
        return list(value)
    raise wrong_type(value, ros_type, "a list, a tuple or an array")


def _is_vector(value: Any) -> bool:
    """Return whether a value is a numpy array; raise a FieldError if it is not flat, or masked."""
    numpy = sys.modules.get("numpy")  # an array exists only if numpy is loaded already
    if numpy is None or not isinstance(value, numpy.ndarray):
        return False
    if value.ndim == 1:
        mask: Any = getattr(value, "mask", None)  # of a masked array; one bool if nothing is
        if mask is None or not mask.any():
            return True
        # Else numpy puts a number of its own there, such as 1e+20.
        problem = (
            f"the array has no value at index {int(mask.argmax())}, which is masked; give"
            " value.filled(...) with a number for it, or value.compressed() without it"
        )
        raise FieldError("", value, problem)
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

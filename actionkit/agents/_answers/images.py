"""Images of topics as files that a language model can see, scaled to a limit."""

from __future__ import annotations

import importlib
import io
import warnings
from typing import Any

from actionkit.agents._values import Image

_TYPES = ("sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage")
_MOST_PIXELS = 100_000_000
"""What a decompressed file may have: it may come from anybody on the network."""
_QUALITY = 80
_RAW: dict[str, tuple[str, str, int]] = {
    # encoding: the mode that it is read to, how it is written, bytes of a pixel
    "rgb8": ("RGB", "RGB", 3),
    "bgr8": ("RGB", "BGR", 3),
    "8UC3": ("RGB", "BGR", 3),
    "rgba8": ("RGB", "RGBX", 4),
    "bgra8": ("RGB", "BGRX", 4),
    "8UC4": ("RGB", "BGRX", 4),
    "mono8": ("L", "L", 1),
    "8UC1": ("L", "L", 1),
}
_DEEP = {"mono16": "u2", "16UC1": "u2", "16SC1": "i2", "32FC1": "f4", "64FC1": "f8"}


class ImageError(Exception):
    """An image that cannot be shown; says why."""


def is_image(ros_type: str) -> bool:
    """Tell whether messages of a type are images."""
    return ros_type in _TYPES


def to_image(message: Any, longest: int) -> tuple[Image, str]:
    """Return an image message as a file, and a sentence of how it was made.

    Args:
        message: A `sensor_msgs/msg/Image` or `CompressedImage`.
        longest: Pixels of the longer side; larger ones are scaled down.

    Raises:
        ImageError: It cannot be shown.
    """
    try:
        pillow: Any = importlib.import_module("PIL.Image")
    except ImportError:
        raise ImageError("Pillow is not installed: pip install pillow") from None
    note = ""
    try:
        if hasattr(message, "encoding"):
            picture, note = _from_raw(pillow, message)
        else:
            picture = _from_file(pillow, bytes(message.data))
        size = picture.size
        picture.thumbnail((longest, longest))
        if picture.mode not in ("L", "RGB"):
            picture = picture.convert("RGB")
        file = io.BytesIO()
        # What has sharp edges for a reason, such as a map or depths, is not blurred.
        kind = "PNG" if note or picture.mode == "L" else "JPEG"
        picture.save(file, kind, **({"quality": _QUALITY} if kind == "JPEG" else {}))
    except ImageError:
        raise
    except Exception as error:  # Pillow raises many kinds for bytes from anywhere
        raise ImageError("the image cannot be read") from error
    width, height = picture.size
    scaled = "" if picture.size == size else f", scaled from {size[0]} x {size[1]}"
    text = f"{width} x {height} pixels{scaled}{note}"
    return Image(f"image/{kind.lower()}", file.getvalue()), text


def _from_raw(pillow: Any, message: Any) -> tuple[Any, str]:
    width, height, step = int(message.width), int(message.height), int(message.step)
    encoding = str(message.encoding)
    data = bytes(message.data)
    deep = _DEEP.get(encoding)
    if encoding not in _RAW and deep is None:
        known = ", ".join([*_RAW, *_DEEP])
        raise ImageError(f"the encoding {encoding!r} cannot be shown; those that can: {known}")
    size = _RAW[encoding][2] if deep is None else int(deep[1])
    if not width or not height:
        raise ImageError(f"the image is empty: {width} x {height} pixels")
    if step < width * size or len(data) < step * (height - 1) + width * size:
        raise ImageError(
            f"the image has {len(data)} bytes, too few for {width} x {height} pixels in rows of"
            f" {step} bytes"
        )
    data = data.ljust(step * height, b"\0")  # the last row may come without its padding
    if deep is None:
        mode, raw, _ = _RAW[encoding]
        return pillow.frombytes(mode, (width, height), data, "raw", raw, step), ""
    return _from_deep(pillow, data, width, height, step, deep, bool(message.is_bigendian))


def _from_deep(
    pillow: Any, data: bytes, width: int, height: int, step: int, kind: str, big: bool
) -> tuple[Any, str]:
    """Spread what has more than 8 bits over black to white: far or high values are light."""
    numpy: Any = importlib.import_module("numpy")
    dtype = numpy.dtype((">" if big else "<") + kind)
    rows = numpy.frombuffer(data, numpy.uint8, step * height).reshape(height, step)
    values = numpy.ascontiguousarray(rows[:, : width * dtype.itemsize]).view(dtype)
    values = values.astype(numpy.float64)
    finite = numpy.isfinite(values)
    if not finite.any():
        raise ImageError("no pixel of the image has a value")
    low, high = float(values[finite].min()), float(values[finite].max())
    spread = numpy.where(finite, values - low, 0.0) * (255.0 / ((high - low) or 1.0))
    picture = pillow.fromarray(spread.clip(0, 255).astype(numpy.uint8))
    return picture, f"; black is {low:g} or no value, white is {high:g}"


def _from_file(pillow: Any, data: bytes) -> Any:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", pillow.DecompressionBombWarning)  # checked below
        picture = pillow.open(io.BytesIO(data))
    if picture.width * picture.height > _MOST_PIXELS:
        raise ImageError(f"the image is too large: {picture.width} x {picture.height} pixels")
    picture.load()
    return picture

"""Writes recordings: what `rosbags` and `mcap` write, from messages that real servers published."""

from __future__ import annotations

import base64
import json
from collections.abc import Iterable
from importlib.resources import files
from pathlib import Path
from typing import NamedTuple

from mcap.writer import Writer as McapWriter
from rosbags.rosbag2 import StoragePlugin, Writer

FIBONACCI = "test_msgs/action/Fibonacci"
LINE = "=" * 80 + "\n"
DEFINITION = (
    f"{LINE}ACTION: {FIBONACCI}\n#goal definition\nint32 order\n---\n#result definition\n"
    "int32[] sequence\n---\n#feedback definition\nint32[] sequence\n"
)
"""As ros2 bag of Kilted and later writes it for each topic of the action that has a type of it."""
_HASH = "RIHS01_" + "0" * 64


class Message(NamedTuple):
    """A message as a recorder gets it."""

    topic: str
    ros_type: str
    stamp: int  # nanoseconds since the epoch
    data: bytes


def night() -> list[Message]:
    """Return what `record_kilted` has recorded: eight goals, with service events."""
    lines = files("tests.recordings").joinpath("night.jsonl").read_text().splitlines()
    return [Message(*rest, base64.b64decode(data)) for *rest, data in map(json.loads, lines)]


def definition_of(ros_type: str) -> str:
    """Return what a recording since Kilted has as the definition of a topic's type."""
    return DEFINITION if ros_type.startswith(FIBONACCI) else "# none of an action\nint32 x\n"


def folder(path: Path, messages: Iterable[Message], storage: StoragePlugin) -> Path:
    """Write a folder, as `ros2 bag record` does; return it."""
    with Writer(path, version=9, storage_plugin=storage) as writer:
        ends = {}
        for topic, ros_type, stamp, data in messages:
            if topic not in ends:
                text = definition_of(ros_type)
                ends[topic] = writer.add_connection(topic, ros_type, msgdef=text, rihs01=_HASH)
            writer.write(ends[topic], stamp, data)
    return path


def mcap(
    path: Path, messages: Iterable[Message], *, types: bool = True, chunk: int = 1 << 20
) -> Path:
    """Write one `.mcap`; without `types` as ros2 bag of Jazzy, which does not find them."""
    with path.open("wb") as file:
        writer = McapWriter(file, chunk_size=chunk)
        writer.start(profile="ros2", library="tests")
        channels: dict[str, int] = {}
        for topic, ros_type, stamp, data in messages:
            if topic not in channels:
                text = definition_of(ros_type).encode() if types else b""
                schema = writer.register_schema(ros_type, "ros2msg" if types else "unknown", text)
                channels[topic] = writer.register_channel(topic, "cdr", schema)
            writer.add_message(channels[topic], stamp, data, stamp)
        writer.finish()
    return path

"""Reads the messages of an action's topics from rosbag2 files, also from damaged ones.

`rosbags` refuses files that were cut off, and `.mcap` files in which a type has no definition, as
in those of Jazzy the types of actions. So the `mcap` library and SQLite read the files.
"""

from __future__ import annotations

import re
import sqlite3
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from struct import Struct
from typing import IO, Any, NamedTuple
from urllib.parse import quote

import yaml

_SUFFIXES = (".mcap", ".db3")
_MAGIC = (b"\x89MCAP0\r\n", b"SQLite format 3\0")
_ZSTD = b"\x28\xb5\x2f\xfd"
"""The first bytes of data that rosbag2 has compressed."""
_MESSAGE = Struct("<BQHIQ")
"""In `.mcap`: the kind of a record, its length, the channel, a number, when it was recorded."""
_IS_MESSAGE = 5


class Message(NamedTuple):
    """A recorded message."""

    topic: str
    ros_type: str
    stamp: int  # when it was recorded, in nanoseconds since the epoch
    data: bytes  # as it was serialised


@dataclass
class Bag:
    """A recording: a folder of files, or one file.

    `messages` fills the other attributes while it reads.
    """

    files: list[Path]
    wanted: Callable[[str], bool]
    """Says whether messages of a topic are read; those of other topics are not decoded."""
    topics: dict[str, str] = field(default_factory=dict)  # all topics with their types
    definitions: dict[str, str] = field(default_factory=dict)  # of types, as they were recorded
    problems: list[str] = field(default_factory=list)  # what could not be read, and why

    def messages(self) -> Iterator[Message]:
        """Yield the messages of the wanted topics, nearly in the order of their recording."""
        for path in self.files:
            read = _mcap if path.suffix == ".mcap" or _magic(path) == _MAGIC[0] else _sqlite
            try:
                yield from read(path, self)
            except OSError:
                raise
            except Exception as error:  # noqa: BLE001  damaged files raise anything
                self.problem(path, error)

    def problem(self, path: Path, error: Exception) -> None:
        """Write down that a part of a file cannot be read."""
        why = str(error).rstrip(".") or type(error).__name__
        self.problems.append(f"{path.name} is cut off or damaged ({why}): a part is missing.")

    def add(self, topic: str, ros_type: str) -> bool:
        """Write down a topic; return whether its messages are wanted."""
        self.topics[topic] = ros_type
        return self.wanted(topic)


def bag_files(path: Path) -> tuple[list[Path], list[str]]:
    """Return the files of a recording in their order, and what is missing; none if it is not one.

    Raises:
        OSError: There is no such file, or it cannot be read.
        ValueError: It is a folder without files of rosbag2, or a file that only has such a name.
    """
    if not path.is_dir():
        if path.suffix == ".zstd":
            raise ValueError(f"{path} is compressed: run `zstd -d {path}` before")
        if path.suffix in _SUFFIXES and not _magic(path):
            raise ValueError(f"{path} is empty, or not what its name says: not a recording")
        return ([path] if _magic(path) else []), []
    found = [each for each in sorted(path.iterdir(), key=_in_order) if each.is_file()]
    files = next(filter(None, ([f for f in found if f.suffix == s] for s in _SUFFIXES)), [])
    names = {each.name for each in files}
    missing = [
        f"{f}: run `zstd -d {f}`" for f in found if f.suffix == ".zstd" and f.stem not in names
    ]
    missing += [str(f) for f in found if f.suffix in _SUFFIXES and f not in files]
    missing += [
        f"{path / name}: no such file" for name in _expected(path) - {f.name for f in found}
    ]
    if not files:
        raise ValueError("; ".join([f"{path} is a folder without .mcap or .db3 files", *missing]))
    return files, [f"not read: {each}" for each in missing]


def _in_order(path: Path) -> list[int]:
    """Return the numbers in a name: the tenth file comes after the ninth."""
    return [int(number) for number in re.findall(r"\d+", path.name)]


def _expected(folder: Path) -> set[str]:
    """Return the names of the files that a recording should have."""
    try:
        metadata = yaml.safe_load((folder / "metadata.yaml").read_text("utf-8"))
        return {
            Path(each).name
            for each in metadata["rosbag2_bagfile_information"]["relative_file_paths"]
        }
    except (OSError, ValueError, KeyError, TypeError, yaml.YAMLError):  # a recorder that was killed
        return set()


def _magic(path: Path) -> bytes:
    """Return the first bytes of a file if they are those of a file of rosbag2."""
    with path.open("rb") as file:
        begin = file.read(16)
    return next((magic for magic in _MAGIC if begin.startswith(magic)), b"")


# --- SQLite ----------------------------------------------------------------------------------


def _sqlite(path: Path, bag: Bag) -> Iterator[Message]:
    with path.open("rb") as file:
        page = int.from_bytes(file.read(18)[16:], "big") or 1
    if path.stat().st_size % page:  # SQLite reads the rest of a cut page as zeros
        bag.problem(path, ValueError("its last page is not whole"))
    wal = path.with_name(f"{path.name}-wal")
    # Without `immutable`, SQLite writes files beside a database that was not closed.
    mode = "mode=ro" if wal.exists() and wal.stat().st_size else "mode=ro&immutable=1"
    connection = sqlite3.connect(f"file:{quote(str(path.absolute()))}?{mode}", uri=True)
    try:
        rows = connection.execute("SELECT id, name, type FROM topics").fetchall()
        topics = {
            int(number): (str(name), str(kind))
            for number, name, kind in rows
            if bag.add(str(name), str(kind))
        }
        with_types = "SELECT topic_type, encoded_message_definition FROM message_definitions"
        with suppress(sqlite3.OperationalError):  # those of Humble have no such table
            for name, text in connection.execute(with_types):
                bag.definitions[str(name)] = str(text)
        # By id, as the index by time is what a cut file lacks first.
        places = ",".join(map(str, topics))
        messages = f"SELECT topic_id, timestamp, data FROM messages WHERE topic_id IN ({places})"
        for number, stamp, data in connection.execute(f"{messages} ORDER BY id"):
            yield Message(*topics[number], int(stamp), _decompressed(bytes(data)))
    finally:
        connection.close()


def _decompressed(data: bytes) -> bytes:
    if not data.startswith(_ZSTD):
        return data
    import zstandard

    return zstandard.ZstdDecompressor().decompressobj().decompress(data)


# --- MCAP ------------------------------------------------------------------------------------


def _mcap(path: Path, bag: Bag) -> Iterator[Message]:
    from mcap.reader import SeekingReader

    with path.open("rb") as file:
        try:
            summary = SeekingReader(file).get_summary()
        except Exception:  # noqa: BLE001  the end of the file is missing
            summary = None
        chunks = summary.chunk_indexes if summary else []
        if summary and chunks and all(chunk.message_index_offsets for chunk in chunks):
            channels = _Channels(bag, summary.schemas.values(), summary.channels.values())
            for chunk in sorted(chunks, key=lambda chunk: chunk.message_start_time):
                try:
                    yield from sorted(_of_chunk(file, chunk, channels), key=lambda each: each.stamp)
                except Exception as error:  # noqa: BLE001  the next chunk may be whole
                    bag.problem(path, error)
        else:
            file.seek(0)
            yield from _in_turn(path, file, bag)


class _Channels(dict[int, tuple[str, str]]):
    """The topics and types of wanted channels by the channels' numbers."""

    def __init__(self, bag: Bag, schemas: Iterable[Any] = (), channels: Iterable[Any] = ()) -> None:
        super().__init__()
        self._bag = bag
        self._types: dict[int, str] = {}
        for record in (*schemas, *channels):
            self.take(record)

    def take(self, record: Any) -> Message | None:
        """Take a record of the file; return the message if it is a wanted one."""
        kind = type(record).__name__
        if kind == "Schema":
            self._types[record.id] = record.name
            if record.data:
                self._bag.definitions[record.name] = record.data.decode()
        elif kind == "Channel":
            ros_type = self._types.get(record.schema_id, "")
            if self._bag.add(record.topic, ros_type):
                self[record.id] = record.topic, ros_type
        elif kind == "Message" and record.channel_id in self:
            return Message(*self[record.channel_id], record.log_time, _decompressed(record.data))
        return None


def _of_chunk(file: IO[bytes], chunk: Any, channels: _Channels) -> list[Message]:
    """Return the wanted messages of a chunk, found by their index, without a look at others."""
    from mcap.data_stream import ReadDataStream
    from mcap.records import Chunk, MessageIndex
    from mcap.stream_reader import get_chunk_data_stream

    def record(place: int, kind: Any) -> Any:
        file.seek(place + 9)  # after the kind and the length
        return kind.read(ReadDataStream(file))

    places = {n: at for n, at in chunk.message_index_offsets.items() if n in channels}
    if not places:
        return []
    stream, size = get_chunk_data_stream(record(chunk.chunk_start_offset, Chunk), validate_crc=True)
    data = stream.read(size)
    found = []
    for number, place in places.items():
        for stamp, at in record(place, MessageIndex).records:
            kind, length, channel, _, logged = _MESSAGE.unpack_from(data, at)
            if (kind, channel, logged) != (_IS_MESSAGE, number, stamp):
                raise ValueError("its index is wrong")
            begin = at + _MESSAGE.size + 8  # after the time at which it was published
            body = _decompressed(data[begin : at + 9 + length])
            found.append(Message(*channels[number], stamp, body))
    return found


def _in_turn(path: Path, file: IO[bytes], bag: Bag) -> Iterator[Message]:
    """Read a file without an index, from its beginning to where it is cut off."""
    from mcap.records import Chunk
    from mcap.stream_reader import StreamReader, breakup_chunk

    channels = _Channels(bag)
    for record in StreamReader(file, emit_chunks=True).records:
        try:
            inner = breakup_chunk(record, True) if isinstance(record, Chunk) else [record]
        except Exception as error:  # noqa: BLE001  the next chunk may be whole
            bag.problem(path, error)
            continue
        yield from filter(None, map(channels.take, inner))

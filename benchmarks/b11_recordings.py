"""11: what `actionkit timeline` needs for a recording with much else in it."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from functools import partial
from pathlib import Path

from mcap.writer import CompressionType, Writer

from benchmarks.measure import Report, Sample, Scale, Verdict, alternate, figure, middle
from tests.recordings import bags

_OTHERS = {"images of 900 kB": 900_000, "messages of 400 bytes": 400}
_CHUNK = 1 << 20
_TOPIC = "/navigate/_action/feedback"


def run_all(scale: Scale) -> Report:
    """Read recordings in which each chunk has a message of an action, so that none is skipped."""
    report = Report(11, "Reading a recording")
    size = scale.pick(2 * 10**8, 10**9)
    with tempfile.TemporaryDirectory() as folder:
        turns = {}
        for name, other in _OTHERS.items():
            path = Path(folder) / f"{other}.mcap"
            _write(path, other, size)
            turns[name] = partial(_read, path)
        samples = alternate(scale.pick(1, 3), turns, "11, recordings")
    for name in turns:
        report.figures += [
            figure("200 MB of a recording", samples, name, "seconds"),
            figure("memory", samples, name, "megabytes"),
        ]
        seconds, memory = (middle(samples[name], key) for key in ("seconds", "megabytes"))
        report.verdicts += [
            Verdict(f"200 MB of a recording with {name}", seconds, 1.0, "s"),
            Verdict(f"memory for a recording with {name}", memory, 100.0, "MB"),
        ]
    return report


def _write(path: Path, other: int, size: int) -> None:
    messages = bags.night()
    feedback = [each.data for each in messages if each.topic == _TOPIC]
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=_CHUNK, compression=CompressionType.NONE)
        writer.start(profile="ros2", library="benchmarks")
        channels: dict[str, int] = {}

        def write(topic: str, ros_type: str, stamp: int, data: bytes) -> None:
            if topic not in channels:
                definition = bags.definition_of(ros_type).encode()
                schema = writer.register_schema(ros_type, "ros2msg", definition)
                channels[topic] = writer.register_channel(topic, "cdr", schema)
            writer.add_message(channels[topic], stamp, data, stamp)

        for message in messages:
            write(*message)
        beside, stamp = bytes(other), messages[-1].stamp
        for number in range(size // other):
            write("/beside", "sensor_msgs/msg/Image", stamp + number, beside)
            if number % max(1, _CHUNK // other) == 0:
                name = f"{bags.FIBONACCI}_FeedbackMessage"
                write(_TOPIC, name, stamp + number, feedback[number % len(feedback)])
        writer.finish()


def _read(path: Path) -> Sample:
    with path.open("rb") as file:  # so that the disk is not measured
        while file.read(_CHUNK):
            pass
    began = time.monotonic()
    with subprocess.Popen(
        [sys.executable, "-m", "actionkit", "timeline", str(path)], stdout=subprocess.DEVNULL
    ) as process:
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    assert process.returncode == 0
    took = (time.monotonic() - began) * 2e8 / path.stat().st_size
    return {"seconds": took, "megabytes": usage.ru_maxrss / 1000}

"""Topics as tools: the latest message with its age, images as images."""

from __future__ import annotations

import asyncio
import io
import threading
from collections.abc import Callable
from contextlib import ExitStack
from typing import Any

import jsonschema
import numpy as np
import PIL.Image
import pytest
from sensor_msgs.msg import CompressedImage, Image

from actionkit._ros.others_goals.survey import Survey
from actionkit.agents import Toolbox
from actionkit.agents._answers.images import ImageError, to_image
from actionkit.agents._answers.plain import plain_json
from tests.waiting import until_in_loop

PUBLISHER = """
import rclpy, sys
from rclpy.qos import QoSProfile, ReliabilityPolicy as R, DurabilityPolicy as D
from sensor_msgs.msg import BatteryState, Image, LaserScan
from std_msgs.msg import String
rclpy.init()
node = rclpy.create_node("robot")
kept = QoSProfile(depth=3, reliability=R.RELIABLE, durability=D.TRANSIENT_LOCAL)
lossy = QoSProfile(depth=1, reliability=R.BEST_EFFORT)
battery = node.create_publisher(BatteryState, "battery", 10)
mode = node.create_publisher(String, "mode", kept)
camera = node.create_publisher(Image, "camera", lossy)
scan = node.create_publisher(LaserScan, "scan", lossy)
quiet = node.create_publisher(String, "quiet", 10)
for text in ("first", "second", "latest"):
    mode.publish(String(data=text))
def publish():
    battery.publish(BatteryState(voltage=12.5, temperature=float("nan")))
    red = b"\\xff\\0\\0" * 640 * 480
    camera.publish(Image(width=640, height=480, step=1920, encoding="rgb8", data=red))
    scan.publish(LaserScan(ranges=[1.0] * 5000))
node.create_timer(0.05, publish)
print("ready", flush=True)
rclpy.spin(node)
"""


def topic(name: str, kind: str, **more: Any) -> dict[str, Any]:
    return {"topic": name, "type": kind, **more}


def test_topics(
    make_toolbox: Callable[..., Toolbox],
    run_script: Any,
    monkeypatch: pytest.MonkeyPatch,
    own_threads: Callable[[], list[str]],
) -> None:
    topics = {
        "battery": topic("/battery", "sensor_msgs/msg/BatteryState", max_age=60),
        "mode": topic("mode", "std_msgs/msg/String"),
        "old": topic("mode", "std_msgs/msg/String", max_age=1e-6),
        "camera": topic("camera", "sensor_msgs/msg/Image", max_size=100),
        "scan": topic("scan", "sensor_msgs/msg/LaserScan", max_size=20),
        "quiet": topic("quiet", "std_msgs/msg/String"),
        "nobody": topic("nobody", "std_msgs/msg/String"),
        "other": topic("quiet", "sensor_msgs/msg/BatteryState"),
    }
    toolbox = make_toolbox(topics=topics)
    schemas = {tool.name: tool.output_schema for tool in toolbox.tools}

    async def read(name: str) -> Any:
        result = await toolbox.call(name, {})
        jsonschema.validate(result.value, schemas[name])
        assert result.is_error == (result.value["status"] != "received")
        return result

    async def main(made: ExitStack) -> None:
        async with toolbox:
            assert run_script(PUBLISHER).line() == "ready"
            names = list(topics)
            # All at once: reading holds neither the event loop nor its threads.
            results = dict(zip(names, await asyncio.gather(*map(read, names)), strict=True))
            values = {name: result.value for name, result in results.items()}
            assert values["battery"]["message"]["voltage"] == 12.5
            assert values["battery"]["message"]["temperature"] == "NaN"
            assert 0 <= values["battery"]["age"] < 5
            assert values["mode"]["message"] == {"data": "latest"}, values["mode"]
            assert values["old"]["status"] == "no_message"
            assert "of the last 1e-06 s" in values["old"]["error"]["message"]
            assert values["camera"]["message"]["width"] == 640
            assert "data" not in values["camera"]["message"]
            (image,) = results["camera"].images
            assert image.mime_type == "image/jpeg"
            picture = PIL.Image.open(io.BytesIO(image.data))
            assert picture.size == (100, 75)
            assert values["camera"]["notes"] == [
                "The image: 100 x 75 pixels, scaled from 640 x 480."
            ]
            assert values["scan"]["message"]["ranges"][19:] == [1.0, "… 4980 more"]
            assert values["scan"]["notes"]
            assert "though it has a publisher" in values["quiet"]["error"]["message"]
            assert "nobody publishes" in values["nobody"]["error"]["message"]
            assert "published as std_msgs/msg/String" in values["other"]["error"]["message"]
            assert (await toolbox.call("battery", {"x": 1})).is_error
            monkeypatch.setattr("actionkit.agents._tool_calls.topics._WAIT", 600.0)
            watching = made.enter_context(Survey())
            # Cancelling ends the subscription, and closing waits for no reading.
            waiting = asyncio.create_task(read("quiet"))

            def subscribed() -> int:
                node = watching.runtime.node
                return len(node.get_subscriptions_info_by_topic("/quiet"))

            await until_in_loop(lambda: subscribed() == 1)
            waiting.cancel()
            await asyncio.wait([waiting])
            assert waiting.cancelled()
            await until_in_loop(lambda: subscribed() == 0)
            assert not any(t.name.startswith("asyncio_") for t in threading.enumerate())
            last = asyncio.create_task(toolbox.call("quiet", {}))
            await asyncio.sleep(0)
        closed = (await last).value
        assert closed["status"] in ("refused", "no_message")
        assert (await toolbox.call("mode", {})).value["status"] == "refused"

    with ExitStack() as made:
        asyncio.run(main(made))
    assert own_threads() == []


LEFT_OPEN = """
import asyncio, atexit, threading
from actionkit._ros.others_goals import topic
from actionkit.agents import Toolbox
reading = threading.Event()
def arriving(self, stopped):
    reading.set()
    return before(self, stopped)
before, topic.TopicReader.arriving = topic.TopicReader.arriving, arriving
toolbox = Toolbox.from_config({"topics": {"t": {"topic": "t", "type": "std_msgs/msg/String"}}})
run = lambda: asyncio.run(toolbox.call("t"))
thread = threading.Thread(target=run, daemon=True)
if {waits}:
    atexit.register(thread.join)  # after ActionKit's own, which come later
thread.start()
reading.wait()
print("ends", flush=True)
"""


@pytest.mark.parametrize("waits", [False, True])
@pytest.mark.long
def test_an_interpreter_ends_while_a_topic_is_read(run_script: Any, waits: bool) -> None:
    script = run_script(LEFT_OPEN.replace("{waits}", str(waits)))
    assert script.line() == "ends"
    assert script.finish() == (0, "", "")


# --- images ------------------------------------------------------------------------------------

RED, GREEN = (250, 10, 20), (10, 240, 30)


def raw(encoding: str, pixels: Any, padding: int = 0, big: int = 0) -> Image:
    """Return an image message of a numpy array, its rows padded."""
    height, width = pixels.shape[:2]
    rows = np.ascontiguousarray(pixels).view(np.uint8).reshape(height, -1)
    rows = np.pad(rows, ((0, 0), (0, padding)))
    return Image(
        width=width,
        height=height,
        step=rows.shape[1],
        encoding=encoding,
        is_bigendian=big,
        data=rows.tobytes(),
    )


def two_colours(*order: int) -> Any:
    pixels = np.zeros((40, 60, len(order)), np.uint8)
    for place, channel in enumerate(order):
        if channel < 3:
            pixels[:20, :, place] = RED[channel]
            pixels[20:, :, place] = GREEN[channel]
    return pixels


@pytest.mark.parametrize(
    ("encoding", "order"),
    [("rgb8", (0, 1, 2)), ("bgr8", (2, 1, 0)), ("rgba8", (0, 1, 2, 3)), ("bgra8", (2, 1, 0, 3))],
)
@pytest.mark.parametrize("padding", [0, 7])
@pytest.mark.every
def test_colours(encoding: str, order: tuple[int, ...], padding: int) -> None:
    image, _ = to_image(raw(encoding, two_colours(*order), padding), 1000)
    picture = PIL.Image.open(io.BytesIO(image.data)).convert("RGB")
    assert picture.size == (60, 40)
    for place, colour in (((30, 8), RED), ((30, 32), GREEN)):
        assert picture.getpixel(place) == pytest.approx(colour, abs=12)


@pytest.mark.parametrize(
    ("encoding", "dtype", "big"),
    [("mono8", "u1", 0), ("mono16", "<u2", 0), ("16UC1", ">u2", 1), ("32FC1", "<f4", 0)],
)
def test_grey_and_depth(encoding: str, dtype: str, big: int) -> None:
    pixels = np.zeros((40, 60), dtype)
    pixels[20:] = 255
    if encoding == "32FC1":
        pixels[0, 0] = np.nan
    image, text = to_image(raw(encoding, pixels, big=big), 30)
    assert image.mime_type == "image/png"
    picture = PIL.Image.open(io.BytesIO(image.data))
    assert picture.size == (30, 20)
    assert picture.getpixel((5, 2)) == 0
    assert picture.getpixel((5, 17)) == 255
    assert ("white is 255" in text) == (encoding != "mono8")


def test_compressed() -> None:
    file = io.BytesIO()
    PIL.Image.new("RGB", (300, 200), RED).save(file, "PNG")
    image, text = to_image(CompressedImage(format="png", data=file.getvalue()), 150)
    assert PIL.Image.open(io.BytesIO(image.data)).size == (150, 100)
    assert "scaled from 300 x 200" in text


@pytest.mark.parametrize(
    ("message", "part"),
    [
        (Image(width=2, height=2, step=6, encoding="bayer_rggb8", data=b"x" * 12), "bayer_rggb8"),
        (Image(width=2, height=2, step=6, encoding="rgb8", data=b"x"), "too few"),
        (Image(width=2**32 - 1, height=2**32 - 1, step=9, encoding="rgb8", data=b"x"), "too few"),
        (Image(encoding="rgb8"), "empty"),
        (CompressedImage(data=b"nonsense"), "the image cannot be read"),
        (CompressedImage(), "the image cannot be read"),
    ],
)
def test_images_that_cannot_be_shown(message: Any, part: str) -> None:
    with pytest.raises(ImageError, match=part):
        to_image(message, 100)


@pytest.mark.long
def test_messages_are_cut_to_what_can_be_read() -> None:
    from test_msgs.msg import MultiNested, UnboundedSequences

    big = UnboundedSequences(
        string_values=["x" * 100_000] * 500, float64_values=[float("inf")] * 100_000
    )
    plain = plain_json(big)
    assert len(str(plain)) < 25_000
    assert plain["string_values"][-1].startswith("… ")
    nested = MultiNested(unbounded_sequence_of_unbounded_sequences=[big] * 50)
    assert len(str(plain_json(nested))) < 60_000

"""What is missing is told, with names and addresses that are known to exist."""

from __future__ import annotations

import pytest

from actionkit._model.missing import ON_LINUX, RCLPY, WITH_ROS, cannot_import
from actionkit._model.ros_packages import how_to_get, joined, repository, wheel

ERROR = ImportError("no such file")


def test_only_names_that_exist_are_proposed() -> None:
    assert wheel("std_msgs") == "ros-jazzy-std-msgs"
    assert wheel("nav2_msgs") is None
    assert repository("nav2_msgs") == "https://github.com/ros-navigation/navigation2"
    assert repository("my_msgs") is None
    assert repository("std_msgs") is None


def test_how_to_get_what_is_missing() -> None:
    assert how_to_get([]) == []
    assert how_to_get({"std_msgs", "nav_msgs"}) == [
        "pip install ros-jazzy-nav-msgs ros-jazzy-std-msgs"
    ]
    rest = (
        ": get the source, put it beside the package that needs it, and build the folder that has"
        " both"
    )
    assert how_to_get(["std_msgs", "my_msgs", "nav2_msgs", "a_msgs"]) == [
        "pip install ros-jazzy-std-msgs",
        "PyPI is not known to have a_msgs, my_msgs or nav2_msgs"
        f" (https://github.com/ros-navigation/navigation2){rest}",
    ]


def test_words_in_a_sentence() -> None:
    assert [joined(list(words)) for words in ("", "a", "ab", "abc")] == [
        "",
        "a",
        "a and b",
        "a, b and c",
    ]
    assert joined(["a", "b"], "or") == "a or b"


def test_a_package_of_ros_that_cannot_be_imported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.platform", "linux")
    assert cannot_import("rclpy", ERROR) == (
        f"rclpy cannot be imported here (ImportError: no such file). {WITH_ROS}. Elsewhere: pip"
        f" install {RCLPY}"
    )
    assert cannot_import("test_msgs", ERROR) == (
        f"test_msgs cannot be imported here (ImportError: no such file). {WITH_ROS} (`sudo apt"
        " install ros-jazzy-test-msgs` where it lacks that). Elsewhere: pip install"
        " ros-jazzy-test-msgs"
    )
    monkeypatch.setattr("sys.platform", "darwin")
    assert cannot_import("rclpy", ERROR) == (
        f"rclpy cannot be imported here (ImportError: no such file). {ON_LINUX}"
    )

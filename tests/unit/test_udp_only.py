"""`actionkit stop` names the variable of Fast DDS's profiles as this ROS 2 reads it."""

from __future__ import annotations

import os
from importlib.metadata import PackageNotFoundError

import pytest

from actionkit._ros.rclpy_private import release
from actionkit._ros.workarounds import udp_only

EARLIER, LATER = "FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE"


@pytest.fixture
def localhost(monkeypatch: pytest.MonkeyPatch) -> None:
    """Give this test an environment of its own, with a range of this computer alone."""
    monkeypatch.setattr(os, "environ", {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"})


@pytest.mark.parametrize(("rclpy", "named"), [("7.1.9", EARLIER), ("9.1.3", LATER), ("", EARLIER)])
def test_variable_follows_the_version_of_rclpy(
    rclpy: str, named: str, localhost: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    def version(name: str) -> str:
        if not rclpy:
            raise PackageNotFoundError(name)
        return rclpy

    monkeypatch.setattr(release, "version", version)
    udp_only.use_udp_only()
    assert {EARLIER, LATER} & os.environ.keys() == {named}


@pytest.mark.parametrize("own", [EARLIER, LATER])
def test_profiles_of_the_user_stay(
    own: str, localhost: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(os.environ, own, "theirs.xml")
    udp_only.use_udp_only()
    assert {name: os.environ.get(name) for name in (EARLIER, LATER)} == {
        **dict.fromkeys((EARLIER, LATER)),
        own: "theirs.xml",
    }

"""The domain of the environment is the one that rcl reads (C1.2)."""

from __future__ import annotations

import pytest
from rclpy.context import Context

from actionkit._model.environment.domain import LAST_DOMAIN, environment_domain
from actionkit._ros.rclpy_private.native import RCLError

TEXTS = (
    "",
    "7",
    "010",
    "08",
    "0x8",
    "0x",
    "+8",
    "-1",
    " 8",
    "8 ",
    "8a",
    "a8",
    "232",
    "1" + 30 * "0",
)
TEXTS += (str(2**64 - 1), "é", "\udcff")


@pytest.mark.parametrize("text", TEXTS)
def test_a_text_means_what_it_means_to_rcl(text, monkeypatch):
    monkeypatch.setenv("ROS_DOMAIN_ID", text)
    context = Context()
    try:
        context.init(args=[], initialize_logging=False)
    except RCLError:
        with pytest.raises(ValueError, match=f"to {LAST_DOMAIN}") as caught:
            environment_domain()
        assert f"ROS_DOMAIN_ID={text!r}" in str(caught.value)
    else:
        assert environment_domain() == context.get_domain_id()
        context.shutdown()


@pytest.mark.parametrize("text", ["233", "-2"])
def test_a_domain_without_ports_is_refused(text, monkeypatch):
    """Fast DDS ends the process there."""
    monkeypatch.setenv("ROS_DOMAIN_ID", text)
    with pytest.raises(ValueError, match="is not a ROS domain: set it to a whole number"):
        environment_domain()

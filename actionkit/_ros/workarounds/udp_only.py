"""Makes Fast DDS use only the network, so that it reaches other users of this computer, too.

By default it uses shared memory between processes of the same computer. Processes of another user
cannot open that memory: they are discovered, but nothing reaches them. If one side has no shared
memory, both use UDP.

This can be deleted when Fast DDS uses UDP by itself where shared memory cannot be opened. It does
not in 2.14, of ROS 2 Jazzy.
"""

from __future__ import annotations

import os
from pathlib import Path

from actionkit._ros.rclpy_private.release import is_kilted_or_later

_RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
_LOCALHOST_ONLY = "ROS_LOCALHOST_ONLY"
"""The variable for the range before ROS 2 Iron; it still overrides the new one."""
_BUILTIN = "FASTDDS_BUILTIN_TRANSPORTS"
_PROFILES = "FASTRTPS_DEFAULT_PROFILES_FILE"
_PROFILES_LATER = "FASTDDS_DEFAULT_PROFILES_FILE"
"""Its name since ROS 2 Kilted, which warns about the old name."""
_OWN = (_PROFILES, _PROFILES_LATER, _BUILTIN, "ROS_STATIC_PEERS")
"""Variables of users with their own transports or peers."""
_FILE = Path(__file__).with_name("udp_on_localhost.xml")


def use_udp_only() -> None:
    """Change the environment of this process and its children, before rclpy is imported.

    The user's own settings for Fast DDS stay.
    """
    if not os.environ.get("RMW_IMPLEMENTATION", "rmw_fastrtps_cpp").startswith("rmw_fastrtps"):
        return
    localhost = os.environ.get(_RANGE, "").upper() == "LOCALHOST"
    if os.environ.get(_LOCALHOST_ONLY) == "1":
        localhost = True
    if not localhost:
        os.environ.setdefault(_BUILTIN, "UDPv4")
        return
    own = any(os.environ.get(name) for name in _OWN)
    if not own and _FILE.is_file():
        # With LOCALHOST rmw_fastrtps sets up shared memory itself, even if the other variables
        # say otherwise. The file has the same range without it; SYSTEM_DEFAULT makes it count.
        os.environ.pop(_LOCALHOST_ONLY, None)
        os.environ[_RANGE] = "SYSTEM_DEFAULT"
        os.environ[_PROFILES_LATER if is_kilted_or_later() else _PROFILES] = str(_FILE)

"""Helpers for tests of code that uses ROS actions, and a pytest plugin with three fixtures.

``ros_domain`` gives a test its own ROS domain. In that domain, ``fake_server`` makes servers of
your own action types, and ``action_server`` starts reference servers. See
`actionkit.testing.plugin`. ``tick_until`` ticks a behaviour tree.
"""

from actionkit.testing._domains import isolated_domain
from actionkit.testing._event_log import EventLog
from actionkit.testing._fake_server import FakeServer
from actionkit.testing._ticking import tick_until

__all__ = ["EventLog", "FakeServer", "isolated_domain", "tick_until"]

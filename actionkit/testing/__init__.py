"""Helpers for tests of code that uses ROS actions, and a pytest plugin with three fixtures.

``ros_domain`` gives a test a ROS domain of its own; ``fake_server`` makes servers of your own
action types in it, and ``action_server`` starts reference servers in it. See
`actionkit.testing.plugin`. ``tick_until`` ticks a behaviour tree.
"""

from actionkit.testing._domains import isolated_domain
from actionkit.testing._event_log import EventLog
from actionkit.testing._fake_server import FakeServer
from actionkit.testing._ticking import tick_until

__all__ = ["EventLog", "FakeServer", "isolated_domain", "tick_until"]

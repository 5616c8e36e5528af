"""Reference action servers: real rclpy servers, each in a process of its own.

From Python:

    with actionkit.servers.start("fibonacci", period=0.1) as server:
        ...                                   # any client, any process
        server.wait_for("accepted")           # what the server itself saw

From a shell: `python -m actionkit.servers --list`.

Most take goals of `test_msgs/action/Fibonacci`; their options, and what they do in detail, are in
`actionkit/servers/_behaviours_*.py`, one class for each:

- that work: fibonacci, countdown, slow_accept, twins (two on one name)
- that look at their other goals: guarded (by rule), queued (one at a time), preemptive (the
  newest wins)
- with more to say, on `test_msgs/action/NestedMessage`: navigate (distance, percent, ETA and
  status as feedback), error_code (a code in the result); and floods (of feedback)
- that fail at first: flaky, restarts (each comes back by itself where its process ended)
- that fail: silent, never_finishes, refuses_cancel, ignores_cancel, slow_cancel, aborts, raises,
  no_result, cancels_itself, blocking, wrong_type, crashes, expires, vanishes

Most of them also serve an action of any other type, which `action_type=` gives: a class, or a name
such as ``"my_robot/action/Pick"``. A goal then has `steps=5` steps, and feedback and results are
empty messages. For a server of your own type that says something, in the process of a test, see
`actionkit.testing.FakeServer`.

countdown and navigate also know the types `actionkit_interfaces/action/Countdown` and
`actionkit_interfaces/action/NavigateToPose`. They speak these only where `action_type=` says so:
what a server speaks does not depend on which packages are installed.

What none of these does can be written as a script, step by step, for the server scripted:

    with actionkit.servers.start(
        "scripted",
        script=[
            ["reject"],                                            # the first goal
            ["accept", {"feedback": 2}, {"restart": "kill"}],      # the second
            [{"feedback": 5, "period": 0.05}, {"abort": [102]}],   # all others
        ],
    ):
        ...

A step that is not right is a `ValueError` at once, which lists all steps that there are.

Importing this package does not import rclpy; only the server's own process does.
"""

from actionkit.servers._events import ServerEvent
from actionkit.servers._process import Server, start
from actionkit.servers._registry import names

__all__ = ["Server", "ServerEvent", "names", "start"]

"""Reference action servers: real rclpy servers, each in a process of its own.

From Python:

    with actionkit.servers.start("fibonacci", period=0.1) as server:
        ...                                   # any client, any process
        server.wait_for("accepted")           # what the server itself saw

From a shell: `python -m actionkit.servers --list`.

Most take goals of `test_msgs/action/Fibonacci`. `actionkit/servers/_behaviours_*.py` has a class
for each, which describes its options and what it does:

- these work: fibonacci, countdown, slow_accept, twins (two on one name)
- these consider their other goals: guarded (has rules), queued (one at a time), preemptive (the
  newest goal wins)
- these send rich messages, on `test_msgs/action/NestedMessage`: navigate (distance, percent, ETA
  and status as feedback), error_code (a code in the result); and floods (much feedback)
- these fail at first: flaky, restarts (if their process ends, they come back by themselves)
- these fail: silent, never_finishes, refuses_cancel, ignores_cancel, slow_cancel, aborts, raises,
  no_result, cancels_itself, blocking, wrong_type, crashes, expires, vanishes

Most of them also serve an action of any other type: give `action_type=` a class, or a name such as
``"my_robot/action/Pick"``. Then a goal has `steps=5` steps, and feedback and results are empty
messages. For a server of your own type with real messages, in the process of a test, see
`actionkit.testing.FakeServer`.

countdown and navigate also know the types `actionkit_interfaces/action/Countdown` and
`actionkit_interfaces/action/NavigateToPose`. They use these only with `action_type=`: the type of a
server does not depend on the installed packages.

For everything else, write a script, step by step, for the server scripted:

    with actionkit.servers.start(
        "scripted",
        script=[
            ["reject"],                                            # the first goal
            ["accept", {"feedback": 2}, {"restart": "kill"}],      # the second
            [{"feedback": 5, "period": 0.05}, {"abort": [102]}],   # all others
        ],
    ):
        ...

A wrong step raises a `ValueError` at once, which lists all possible steps.

Importing this package does not import rclpy; only the server's own process imports it.
"""

from actionkit.servers._behaviours.registry import names
from actionkit.servers._events import ServerEvent
from actionkit.servers._process import Server, start

__all__ = ["Server", "ServerEvent", "names", "start"]

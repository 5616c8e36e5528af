"""Reference servers that fail only for their first goals; some of them end their process."""

from __future__ import annotations

from itertools import islice
from typing import ClassVar

from actionkit.servers._behaviours.basic import Fibonacci, fibonacci_steps
from actionkit.servers._run import Run


class Flaky(Fibonacci):
    """Fails its first goals, `fails` = 2 of them; then works as fibonacci.

    how=aborts: ends them as ABORTED, half-way, with the numbers that it has. how=rejects.
    how=silent: does not answer the goal request. how=crashes: it vanishes half-way, as with
    SIGKILL, and comes back at once. ``Server.restart()`` does not start the count again.
    """

    any_type = True
    options: ClassVar = {**Fibonacci.options, "fails": 2, "how": "aborts"}
    choices: ClassVar = {"how": ("aborts", "rejects", "silent", "crashes")}

    def takes_time_to_decide(self, run: Run) -> bool:
        return self._fails(run, "silent")

    def decide(self, run: Run) -> bool:
        if self._fails(run, "silent"):
            run.wait_forever()
        if self._fails(run, "rejects"):
            return run.refuse("flaky")
        return super().decide(run)

    def execute(self, run: Run) -> object:
        if not self._fails(run, "aborts", "crashes"):
            return super().execute(run)
        self.compute(run, islice(fibonacci_steps(run.order), run.order // 2))
        if self._fails(run, "crashes"):
            run.emit("crashing", point="half-way")
            self.life.restart("kill")
        return run.abort()

    def _fails(self, run: Run, *ways: str) -> bool:
        return run.number < int(self.option["fails"]) and self.option["how"] in ways


class Restarts(Fibonacci):
    """Restarts in the middle of its first goals, `times` = 1 of them; then works as fibonacci.

    The goal is gone afterwards. how=clean: the server leaves the ROS graph properly. how=kill: it
    vanishes, as with SIGKILL. In both cases its program starts again at once, in the same process,
    and keeps only the count of goals: its parent notices nothing.

    point=feedback: while the goal executes, after a first feedback. point=accepted: before anything
    executes. Both wait until a client has asked for the result: earlier, the acceptance itself
    could be lost with the server.
    """

    any_type = True
    options: ClassVar = {**Fibonacci.options, "times": 1, "how": "clean", "point": "feedback"}
    choices: ClassVar = {"how": ("clean", "kill"), "point": ("accepted", "feedback")}

    def begin(self, run: Run) -> None:
        if not self._restarts_at("accepted", run):
            run.begin()

    def cancelled(self, run: Run) -> None:
        if self._restarts_at("accepted", run):
            run.drop()

    def result_requested(self, run: Run) -> None:
        if self._restarts_at("accepted", run):
            self._restart("accepted", run)

    def execute(self, run: Run) -> object:
        if not self._restarts_at("feedback", run):
            return super().execute(run)
        run.feedback([0, 1])
        run.wait_result_request()
        self._restart("feedback", run)
        run.wait_forever()
        return None

    def _restarts_at(self, point: str, run: Run) -> bool:
        return run.number < int(self.option["times"]) and point == str(self.option["point"])

    def _restart(self, point: str, run: Run) -> None:
        run.emit("leaving", point=point, how=self.option["how"])
        self.life.restart(self.option["how"])

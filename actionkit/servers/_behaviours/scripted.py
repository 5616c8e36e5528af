"""Reference servers that follow a script: from a test, or a preset."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, ClassVar

from actionkit.servers._behaviours.basic import fibonacci_steps
from actionkit.servers._behaviours.behaviour import Behaviour, Process
from actionkit.servers._behaviours.steps import MODES, Script, Step, parse_scripts, read_scripts
from actionkit.servers._run import Run


class ByScript(Behaviour):
    """Does what a script says, step by step."""

    any_type = True

    def __init__(self, options: Mapping[str, Any], process: Process) -> None:
        super().__init__(options, process)
        self._scripts = self.scripts()
        if any(step.word == "cancel_itself" for one in self._scripts for step in one.after):
            process.enable_self_cancel()

    def scripts(self) -> list[Script]:
        """Return a script for each goal in turn; the last one repeats."""
        raise NotImplementedError

    def begin_step(self, run: Run, step: Step) -> None:
        """Called when a step begins."""

    def script_of(self, run: Run) -> Script:
        """Return the script of a goal."""
        return self._scripts[min(run.number, len(self._scripts) - 1)]

    def received(self, run: Run) -> None:
        run.content = [0, 1]

    def takes_time_to_decide(self, run: Run) -> bool:
        script = self.script_of(run)
        return script.decision.word in ("accept_after", "no_answer") or any(
            step.word not in MODES for step in script.before
        )

    def decide(self, run: Run) -> bool:
        script = self.script_of(run)
        for step in script.before:
            self._do(run, step)
        if script.explicit:
            self.begin_step(run, script.decision)
        if script.decision.word == "no_answer":
            run.wait_forever()
        if script.decision.word == "accept_after":
            run.pause(script.decision.value)
        return script.decision.word != "reject" or run.refuse("script")

    def may_cancel(self, run: Run) -> bool:
        return not run.refuses_cancel

    def execute(self, run: Run) -> object:
        for step in self.script_of(run).after:
            run.pause(0)
            if step.word in ("succeed", "abort", "raise", "no_result"):
                return self._end(run, step)
            self._do(run, step)
        run.pause(0)
        return run.succeed()

    def stopped(self, run: Run) -> object:
        run.heeds_cancel = False
        run.pause(run.notes or 0)
        return run.canceled()

    def _end(self, run: Run, step: Step) -> object:
        self.begin_step(run, step)
        if step.word == "raise":
            # Before it happens: rclpy ends the goal without a call.
            run.emit("aborted", raised=True)
            raise ValueError("this reference server raises on purpose")
        if step.word == "abort":
            return run.abort(step.value)
        result = run.succeed(step.value)
        return None if step.word == "no_result" else result

    def _do(self, run: Run, step: Step) -> None:
        self.begin_step(run, step)
        if step.word == "feedback":
            one = isinstance(step.value, list)
            steps: Iterable[Any] = [step.value] if one else fibonacci_steps(step.value + 1)
            for sequence in steps:
                run.pause(step.period)
                run.feedback(sequence)
        elif step.word == "wait":
            run.pause(step.value)
        elif step.word == "gate":
            run.wait_gate()
        elif step.word in MODES:
            run.notes = step.value  # the seconds of "cancel_after"
            run.refuses_cancel = step.word == "refuse_cancel"
            run.heeds_cancel = step.word in ("heed_cancel", "cancel_after")
        elif step.word == "cancel_itself":
            self.process.cancel_from_elsewhere(run.goal_id)
        else:
            self._stay(run, step)

    def _stay(self, run: Run, step: Step) -> None:
        """Do a step that does not end by itself."""
        if step.word == "crash" and step.value == "kill":
            self.life.crash(run, "script")
        elif step.word == "crash":
            run.emit("leaving", how="clean")
            self.life.end()
        elif step.word == "restart":
            run.emit("leaving", how=step.value)
            self.life.restart(step.value)
        elif run.heeds_cancel:
            run.wait_cancel()
            run.pause(0)
        run.wait_forever()


class Preset(ByScript):
    """A script with a name of its own; the journal does not show its steps.

    Attributes:
        steps: What happens to each goal.
    """

    steps: ClassVar[Sequence[object]]

    def scripts(self) -> list[Script]:
        return read_scripts(list(self.steps))

    def decide(self, run: Run) -> bool:
        return super().decide(run) and run.order >= 0


class Scripted(ByScript):
    """Does what its script says, step by step.

        servers.start("scripted", script=["accept", {"feedback": 3, "period": 0.1}, "gate",
                                          {"abort": [102]}])
        servers.start("scripted", script=[["reject"], [{"crash": "kill"}], [{"succeed": [0, 1]}]])

    A script is a list of steps, the same for every goal. Or it is a list of scripts, one for each
    goal in turn, also over restarts; the last one repeats. In a shell it is JSON:
    ``--option 'script=[["reject"], [{"feedback": 3}]]'``.

    The answer to the request. If the script has none of these steps, the goal is accepted before
    the first other step. Steps before one of these are done before the answer:

    - ``"accept"``, ``{"accept_after": 0.5}`` (seconds), ``"reject"``
    - ``"no_answer"``: never answers

    The execution. If the script has no step that ends the goal, the goal succeeds:

    - ``{"feedback": [1, 2, 3]}``: one feedback with that sequence; ``{"feedback": 5}``: so many,
      with the numbers of Fibonacci; both with ``"period": 0.05``: seconds before each
    - ``{"wait": 0.2}`` (seconds), ``"gate"`` (until ``Server.release()``)
    - ``"succeed"``, ``{"succeed": [0, 1]}``, ``"abort"``, ``{"abort": [102]}``: the end, with the
      last feedback as the result, or with that sequence
    - ``"raise"``: an exception, which rclpy turns into ABORTED; ``"no_result"``: succeeds, and its
      result is never sent; ``"never"``: executes until it is cancelled
    - ``{"crash": "kill"}``, ``{"crash": "clean"}``: the end of the process, until
      ``Server.restart()``; ``{"restart": "kill"}``, ``{"restart": "clean"}``: it is back at once

    The reaction to a cancel. A goal ends as CANCELED at once, with the last feedback as the result,
    unless one of these steps came before:

    - ``"refuse_cancel"``: requests are refused; ``"ignore_cancel"``: accepted, without effect;
      ``{"cancel_after": 0.3}``: accepted, and the goal takes that many seconds to end;
      ``"heed_cancel"``: as at the beginning
    - ``"cancel_itself"``: another client, in the server process, cancels the goal

    Each step is an event "step" in the journal, with its `index` in the script and its `word`.
    """

    options: ClassVar = {"script": "[]"}

    @classmethod
    def parse(
        cls, given: Mapping[str, str], *, foreign: bool = False
    ) -> dict[str, int | float | str]:
        options = super().parse(given, foreign=foreign)
        scripts = parse_scripts(str(options["script"]))
        for step in (step for script in scripts for step in script.after):
            if foreign and isinstance(step.value, list):
                raise ValueError(
                    f"the script's step {step.word!r} has numbers {step.value}, which are the"
                    f" sequence of {cls.action_type}. For another type leave them out, or use"
                    " actionkit.testing.FakeServer, whose messages may say anything"
                )
        return options

    def scripts(self) -> list[Script]:
        return parse_scripts(self.option["script"])

    def begin_step(self, run: Run, step: Step) -> None:
        run.emit("step", index=run.steps, word=step.word)
        run.steps += 1

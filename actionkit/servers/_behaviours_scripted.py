"""The server whose script is written by the test that uses it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, ClassVar

from ._behaviours_basic import fibonacci_steps
from ._registry import Behaviour, Process, server
from ._run import Run
from ._steps import MODES, Script, Step, parse_scripts


class _CancelledError(Exception):
    """The goal is being cancelled and heeds that."""


class _Play:
    """How far one goal has got."""

    def __init__(self, script: Script) -> None:
        self.script = script
        self.index = 0
        self.sequence = [0, 1]
        self.refuses = False
        self.heeds = True
        self.delay = 0.0


@server
class Scripted(Behaviour):
    """Does what its script says, step by step.

    ::

        servers.start("scripted", script=["accept", {"feedback": 3, "period": 0.1}, "gate",
                                          {"abort": [102]}])
        servers.start("scripted", script=[["reject"], [{"crash": "kill"}], [{"succeed": [0, 1]}]])

    A script is a list of steps, the same for every goal; or a list of scripts, one for each goal
    in turn, restarts included, the last of which repeats. In a shell it is JSON:
    ``--option 'script=[["reject"], [{"feedback": 3}]]'``.

    What is done about the request. It is accepted before the first other step where none of
    these is in the script; steps that stand before one of these come before the decision:

    - ``"accept"``, ``{"accept_after": 0.5}`` (seconds), ``"reject"``
    - ``"no_answer"``: never answers it

    What happens then; where the script ends without an end, the goal succeeds:

    - ``{"feedback": [1, 2, 3]}``: one with that sequence; ``{"feedback": 5}``: so many, with the
      numbers of Fibonacci; both with ``"period": 0.05``: seconds before each
    - ``{"wait": 0.2}`` (seconds), ``"gate"`` (until ``Server.release()``)
    - ``"succeed"``, ``{"succeed": [0, 1]}``, ``"abort"``, ``{"abort": [102]}``: the end, with the
      last feedback as the result, or with that sequence
    - ``"raise"``: an exception, which rclpy makes ABORTED; ``"no_result"``: succeeds, and its
      result is never sent; ``"never"``: executes until it is cancelled
    - ``{"crash": "kill"}``, ``{"crash": "clean"}``: the end of the process, until
      ``Server.restart()``; ``{"restart": "kill"}``, ``{"restart": "clean"}``: it is back at once

    About cancels. A goal ends CANCELED at once, with the last feedback as the result, unless one
    of these came before:

    - ``"refuse_cancel"``: requests are refused; ``"ignore_cancel"``: accepted, without effect;
      ``{"cancel_after": 0.3}``: accepted, and the goal takes so many seconds to end;
      ``"heed_cancel"``: as at first
    - ``"cancel_itself"``: another client, in the server process, cancels the goal

    Each step is an event "step" in the journal, with its `index` in the script and its `word`.
    """

    options: ClassVar = {"script": "[]"}

    @classmethod
    def parse(cls, given: Mapping[str, str]) -> dict[str, int | float | str]:
        options = super().parse(given)
        parse_scripts(str(options["script"]))
        return options

    def __init__(self, options: Mapping[str, Any], process: Process) -> None:
        super().__init__(options, process)
        self._scripts = parse_scripts(options["script"])
        if any(step.word == "cancel_itself" for one in self._scripts for step in one.after):
            process.enable_self_cancel()

    def received(self, run: Run) -> None:
        run.notes = _Play(self._scripts[min(run.number, len(self._scripts) - 1)])

    def takes_time_to_decide(self, run: Run) -> bool:
        script = run.notes.script
        return script.decision.word in ("accept_after", "no_answer") or any(
            step.word not in MODES for step in script.before
        )

    def decide(self, run: Run) -> bool:
        script = run.notes.script
        for step in script.before:
            self._do(run, step)
        if script.explicit:
            self._note(run, script.decision)
        if script.decision.word == "no_answer":
            run.wait_forever()
        if script.decision.word == "accept_after":
            run.rest(script.decision.value)
        return script.decision.word != "reject" or run.refuse("script")

    def may_cancel(self, run: Run) -> bool:
        return not run.notes.refuses

    def execute(self, run: Run) -> object:
        play = run.notes
        try:
            for step in play.script.after:
                self._heed(run)
                if step.word in ("succeed", "abort", "raise", "no_result"):
                    return self._end(run, step)
                self._do(run, step)
            self._heed(run)
        except _CancelledError:
            run.rest(play.delay)
            return run.canceled(play.sequence)
        return run.succeed(play.sequence)

    def _end(self, run: Run, step: Step) -> object:
        self._note(run, step)
        sequence = run.notes.sequence if step.value is None else step.value
        if step.word == "raise":
            # rclpy ends the goal, after this; nothing of ours runs by then.
            run.emit("aborted", raised=True)
            raise ValueError("the script says so")
        if step.word == "abort":
            return run.abort(sequence)
        result = run.succeed(sequence)
        return None if step.word == "no_result" else result

    def _do(self, run: Run, step: Step) -> None:
        self._note(run, step)
        play = run.notes
        if step.word == "feedback":
            self._feedback(run, step)
        elif step.word == "wait":
            self._wait(run, step.value)
        elif step.word == "gate":
            run.wait_gate(heed_cancel=play.heeds)
            self._heed(run)
        elif step.word in MODES:
            play.delay = step.value or 0.0
            play.refuses = step.word == "refuse_cancel"
            play.heeds = step.word in ("heed_cancel", "cancel_after")
        elif step.word == "cancel_itself":
            self.process.cancel_from_elsewhere(run.goal_id)
        else:
            self._stay(run, step)

    def _feedback(self, run: Run, step: Step) -> None:
        one = isinstance(step.value, list)
        sequences: Iterable[list[int]] = [step.value] if one else fibonacci_steps(step.value + 1)
        for sequence in sequences:
            self._wait(run, step.period)
            run.notes.sequence = sequence
            run.feedback(sequence)

    def _stay(self, run: Run, step: Step) -> None:
        """The steps that do not come to an end by themselves."""
        if step.word == "crash" and step.value == "kill":
            self.process.crash(run, "script")
        elif step.word == "crash":
            run.emit("leaving", how="clean")
            self.process.end()
        elif step.word == "restart":
            run.emit("leaving", how=step.value)
            self.process.restart(step.value)
        elif run.notes.heeds:
            run.wait_cancel()
            self._heed(run)
        run.wait_forever()

    def _wait(self, run: Run, seconds: float) -> None:
        if run.notes.heeds:
            run.pause(seconds)
            self._heed(run)
        else:
            run.rest(seconds)

    def _heed(self, run: Run) -> None:
        if run.cancelled and run.notes.heeds:
            raise _CancelledError

    def _note(self, run: Run, step: Step) -> None:
        run.emit("step", index=run.notes.index, word=step.word)
        run.notes.index += 1

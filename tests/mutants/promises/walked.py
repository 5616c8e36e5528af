"""Mutants that the walk through the states of calls and goals must find by itself.

Other tests notice most of them sooner. These show that the walk does not go past broken code.
"""

from __future__ import annotations

from tests.mutants.mutant import Mutant

_WALK = ("unit/test_call_explored.py::test_no_promise_is_broken_anywhere",)


def _found(promise: str, wrong: str, path: str, old: str, new: str) -> Mutant:
    return Mutant(promise, wrong, path, old, new, _WALK, long=True)


MUTANTS = (
    _found(
        "C1.5",
        "a goal is sent that nobody wants",
        "_calls/sending/machine.py",
        "if self.unwanted and not self.attaches:",
        "if False:",
    ),
    _found(
        "C2.1",
        "a goal is sent when the time is up",
        "_calls/sending/machine.py",
        "        too_late = self._is_late(now) and not self._cancel_waits\n",
        "        too_late = False\n",
    ),
    _found(
        "C2.7",
        "a goal waits for its turn while no server is there",
        "_calls/sending/machine.py",
        "self._await_server(now) if waits_for_earlier or self.phase is Phase.QUEUED else []",
        "[]",
    ),
    _found(
        "C2.7",
        "a server that is there is waited for",
        "_calls/sending/machine.py",
        """\
        \"\"\"A server can be used, or an earlier goal is known not to run any more.\"\"\"
        if self.phase is not Phase.WAITING:""",
        """\
        \"\"\"A server can be used, or an earlier goal is known not to run any more.\"\"\"
        if self.phase is not Phase.WAITING or self.earlier:""",
    ),
    _found(
        "C3.1",
        "nobody is told that another type is served",
        "_calls/sending/machine.py",
        """\
        \"\"\"The name is served with other types only.\"\"\"
        if self.phase is not Phase.WAITING:""",
        """\
        \"\"\"The name is served with other types only.\"\"\"
        if True:""",
    ),
    _found(
        "C2.7",
        "the timers of a call that found no server go on",
        "_calls/sending/machine.py",
        ", cx.StopRetrying()]",
        "]",
    ),
    _found(
        "C2.7",
        "a call without a server ends with the error of a deadline",
        "_calls/sending/machine.py",
        "if self.phase is Phase.QUEUED:",
        "if True:",
    ),
    _found(
        "C2.7",
        "a goal that waited for its turn ends as if no server was there",
        "_calls/sending/machine.py",
        "        ending = fx.Ending(fx.End.DEADLINE,",
        "        ending = fx.Ending(fx.End.NO_SERVER,",
    ),
    _found(
        "C2.7",
        "no server was there, though a goal was sent before",
        "_calls/sending/machine.py",
        "self._last, self._server_limit",
        "None, self._server_limit",
    ),
    _found(
        "C1.5",
        "a call that has ended stays in the queue",
        "_calls/sending/machine.py",
        "[cx.StopRetrying(), *self._finish()]",
        "self._finish()",
    ),
    _found(
        "C4.3",
        "a goal waits for its turn, though an earlier one has succeeded",
        "_calls/sending/machine.py",
        "effects: list[cx.Effect] = [cx.StopRetrying()]",
        "effects: list[cx.Effect] = []",
    ),
    _found(
        "C4.2",
        "a goal is sent while an earlier one may run",
        "_calls/sending/machine.py",
        "return all(",
        "return True or all(",
    ),
    _found(
        "C4.2",
        "a goal is sent while the server of an earlier one is in sight",
        "_goal/facts.py",
        "(unless_gone and self.is_lost_with_server)",
        "unless_gone",
    ),
    _found(
        "C4.2",
        "a guess that a server was restarted lets a goal be sent",
        "_goal/facts.py",
        " and self.servers_gone",
        "",
    ),
    _found(
        "C4.3",
        "a goal is sent while the result of an earlier one may come",
        "_calls/sending/machine.py",
        "return ended_as is None or",
        "return True or",
    ),
    _found(
        "C4.2",
        "earlier attempts are forgotten when the next one ends",
        "_calls/sending/machine.py",
        "(*self.earlier, attempt)",
        "(attempt,)",
    ),
    _found(
        "C4.3",
        "a goal that has ended is not looked at while its result may come",
        "_calls/sending/machine.py",
        " or each.goal.awaits_result_of",
        "",
    ),
    _found(
        "C2.8",
        "who cancels waits for no earlier goal",
        "_calls/sending/machine.py",
        "        if ending.end in _GIVEN_UP and self.confirming",
        "        if ending.end in _GIVEN_UP and False",
    ),
    _found(
        "C2.8",
        "the end names no goal that may run",
        "_calls/sending/machine.py",
        "self.goals.reports",
        "()",
    ),
    _found(
        "C4.3",
        "a late success is not heard",
        "_calls/sending/machine.py",
        "if attempt not in self.earlier or",
        "if True or",
    ),
    _found(
        "C1.5",
        "a call that nobody wants is tried again",
        "_calls/sending/machine.py",
        "if why:",
        "if False:",
    ),
    _found(
        "C1.15",
        "a goal that was replaced is sent again",
        "_calls/sending/machine.py",
        "if self._replacement is not None:",
        "if False:",
    ),
    _found(
        "C1.15",
        "a goal waits to be sent though another was sent in its place",
        "_calls/sending/machine.py",
        "if self.attempt is not None else self.give_up",
        "if True else self.give_up",
    ),
    _found(
        "C1.15",
        "a goal that was replaced looks like a failure",
        "_calls/sending/machine.py",
        "if ending.end in _STOPPED and self._is_replaced:",
        "if False:",
    ),
    _found(
        "C1.15",
        "a goal counts as replaced by one that was refused",
        "_calls/sending/machine.py",
        "(call.phase is not Phase.ENDED or call.goals.accepted)",
        "True",
    ),
    _found(
        "C1.16",
        "a goal that is left alone is cancelled when its server is back",
        "_goal/machine.py",
        "self.forget() if self._is_left_alone else []",
        "[]",
    ),
    _found(
        "C1.16",
        "a goal that is left alone is cancelled at the deadline",
        "_goal/cancelling.py",
        "(self._is_left_alone and why is not CancelReason.CANCELLED)",
        "False",
    ),
    _found(
        "C2.4",
        "a late acceptance is not cancelled",
        "_goal/machine.py",
        "if self.unwanted:",
        "if False:",
    ),
    _found(
        "C2.4",
        "a late acceptance is not cancelled after another server's refusal",
        "_goal/record.py",
        " or self._refused_reason is not None",
        "",
    ),
    _found(
        "C2.8",
        "a lost goal counts as stopped",
        "_goal/facts.py",
        "if self.is_over:",
        "if self.is_over or self.lost:",
    ),
    _found(
        "C2.8",
        "an unanswered goal counts as stopped",
        "_goal/facts.py",
        "(self.accepted or self.noes < self.servers)",
        "self.accepted",
    ),
    _found(
        "C2.8",
        "that a server does not know a goal counts as its end",
        "_goal/machine.py",
        "self._unknown_to_server = self._denied_lately = True",
        "self.facts.noes = 1",
    ),
    _found(
        "C2.4",
        "a lost goal is not cancelled when its server is back",
        "_goal/machine.py",
        "may be outdated.\n        return [fx.AskCancel(), ",
        "may be outdated.\n        return [",
    ),
    _found(
        "C2.4",
        "giving up asks for no cancel",
        "_goal/cancelling.py",
        "else self._ask_all_to_cancel(now)",
        "else [fx.AskResult()]",
    ),
    _found(
        "C2.8",
        "one of two servers rejects it, and so it does not run",
        "_goal/facts.py",
        "self.noes < self.servers",
        "self.noes < 1",
    ),
    _found(
        "C2.8",
        "one of two servers has ended it, and so it does not run",
        "_goal/machine.py",
        "if facts.undecided:",
        "if facts.ends:",
    ),
    _found(
        "C2.8",
        "a second server that accepts it does not count",
        "_goal/facts.py",
        "max(self.yeses, int(self.accepted))",
        "int(self.accepted)",
    ),
    _found(
        "C2.8",
        "a second server that may accept it does not count for who gave up",
        "_goal/facts.py",
        " or (self.given_up and self.undecided)",
        "",
    ),
    _found(
        "C2.8",
        "who gave up does not wait for a second server",
        "_goal/record.py",
        """\
        effects: list[fx.Effect] = []
        if self.cancel_reason is None:""",
        """\
        effects: list[fx.Effect] = []
        if True:""",
    ),
    _found(
        "C2.4",
        "a second server is not asked to cancel it",
        "_goal/record.py",
        "fx.AskCancel(), ",
        "",
    ),
    _found(
        "C2.8",
        "of two servers one that is out of sight does not count",
        "_goal/machine.py",
        " and not facts.away",
        "",
    ),
    _found(
        "C2.8",
        "an abandoned goal is told as stopped",
        "_goal/cancelling.py",
        """\
        self._phase = "accept" if self.stage is Stage.SENT else "execute"
        self.lose_touch()""",
        """\
        self._phase = "accept" if self.stage is Stage.SENT else "execute"
        pass""",
    ),
    _found(
        "C2.1",
        "the deadline does not end a pause",
        "_calls/sending/machine.py",
        "if self.phase is Phase.PAUSING",
        "if False",
    ),
    _found(
        "C2.3",
        "the deadline does not reach a goal that is being cancelled",
        "_goal/cancelling.py",
        "if why in FINAL:",
        "if why is CancelReason.CLOSED:",
    ),
    _found(
        "C2.8",
        "a goal that nobody waits for is waited for, as its cancel was refused",
        "_goal/cancelling.py",
        "if self._final_reason is not None:",
        "if False:",
    ),
)

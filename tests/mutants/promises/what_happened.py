"""Mutants of what can be seen of calls: the timeline, the log, observers, the command line."""

from __future__ import annotations

from tests.mutants.mutant import Mutant

MUTANTS = (
    Mutant(
        "C6.1",
        "the timeline of a call with many attempts grows for ever",
        "_model/timeline.py",
        "        if len(kept) >= _MOST:\n",
        "        if len(kept) >= 100 * _MOST:\n",
        (
            "unit/test_timeline.py::"
            "test_a_call_that_goes_on_for_ever_keeps_its_beginning_and_its_end",
        ),
    ),
    Mutant(
        "C6.2",
        "what happens to a goal after its call is over is not told",
        "_calls/call.py",
        "        event = self._record.note(\n            attempt.goal_id,",
        "        if self._settled:\n            return\n"
        "        event = self._record.note(\n            attempt.goal_id,",
        ("client/test_cancel.py::test_late_acceptance_after_the_deadline_is_cancelled",),
    ),
    Mutant(
        "C6.2",
        "an observer that blocks holds up the log and the other observers",
        "_observers/delivery.py",
        "        most = 1 + len(observers)\n",
        "        most = 1\n",
        ("unit/test_observers.py::test_one_that_blocks_or_raises_harms_nobody_else",),
    ),
    Mutant(
        "C6.2",
        "an observer that has raised is told what comes after",
        "_observers/delivery.py",
        "            self._dropped = True\n",
        "            self._dropped = False\n",
        ("client/test_observers_real.py::test_a_raising_observer_is_dropped_and_others_go_on",),
    ),
    Mutant(
        "C6.2",
        "an observer may block in its callback until a goal ends that waits for it",
        "_threads/pool.py",
        "        in_callback.set(True)\n",
        "        pass\n",
        ("client/test_observers_real.py::test_blocking_calls_are_refused_in_an_observer",),
    ),
    Mutant(
        "C6.3",
        "codes 22 and 23 never come from a call",
        "cli/_shared/exits.py",
        "    return _MAY_RUN.get(str(outcome.cancel), code)\n",
        "    return code\n",
        ("cli/test_calling.py::test_a_goal_that_may_run_decides_about_the_exit_code",),
    ),
    Mutant(
        "C6.3",
        "codes 22 and 23 come only if the call succeeded",
        "cli/_shared/exits.py",
        "    return _MAY_RUN.get(str(outcome.cancel), code)\n",
        "    return _MAY_RUN.get(str(outcome.cancel), code) if code is Exit.OK else code\n",
        ("cli/test_calling.py::test_a_goal_that_may_run_decides_about_the_exit_code",),
    ),
    Mutant(
        "C6.3",
        "a goal that was not answered has the code of a deadline",
        "cli/_shared/exits.py",
        '    ("AcceptanceTimeoutError", Exit.NO_ANSWER),\n',
        "",
        ("cli/test_call.py::test_a_call[no-answer]",),
    ),
    Mutant(
        "C6.3",
        "a goal that succeeded counts as stopped by the deadline, if its result did not come",
        "cli/_shared/exits.py",
        "    if ended_without_result(outcome) is not None:\n",
        "    if False:\n",
        ("cli/test_call.py::test_a_call[result-late]",),
    ),
    Mutant(
        "C6.3",
        "a goal is sent although a signal came before",
        "cli/call/_calling.py",
        "        if self._code is not None:  # a signal came, or nobody gets the output\n",
        "        if self._code is Exit.OUTPUT_CLOSED:\n",
        ("cli/test_calling.py::test_a_signal_before_the_goal_is_sent_keeps_it_back",),
    ),
    Mutant(
        "C6.3",
        "Ctrl-C does not cancel the goal",
        "cli/call/_calling.py",
        "        self._future.cancel()\n",
        "",
        ("cli/test_calling.py::test_the_first_ctrl_c_cancels_at_once",),
    ),
    Mutant(
        "C6.3",
        "the cancelling of one goal cancels all goals of the action",
        "cli/cancel_and_stop/cancel.py",
        "Cancelling(full, goal_ids or None, may_come=may_come)",
        "Cancelling(full, None, may_come=may_come)",
        ("cli/test_cancel.py::test_goals_are_listed_and_canceled_by_id_and_all_at_once",),
    ),
)

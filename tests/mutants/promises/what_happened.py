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
        "C6.1",
        "a goal's feedback pushes other events out of the timeline",
        "_model/timeline.py",
        "            kept = _without_the_last_of_two(kept, event.goal_id)\n",
        "            pass\n",
        ("unit/test_timeline.py::test_the_first_and_the_last_feedback_are_kept",),
    ),
    Mutant(
        "C6.2",
        "what happens to a goal after its call is over is not told",
        "_calls/sending/call.py",
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
        "a handler of the log that raises is told nothing more",
        "_observers/delivery.py",
        "        if not self.is_log:\n            self._dropped",
        "        if True:\n            self._dropped",
        ("unit/test_observers.py",),
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
        "a goal that was not answered has the code of any other failure",
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
    Mutant(
        "C6.3",
        "Ctrl-C in `attach` cancels the goal of another program",
        "cli/call/_calling.py",
        "        if self._detaches and self._code is None:\n",
        "        if False:\n",
        ("cli/test_attach.py::test_ctrl_c_lets_the_goal_run",),
    ),
    Mutant(
        "C6.3",
        "a second Ctrl-C is not heard",
        "cli/call/_calling.py",
        "        times = 2 if self._detaches else 1\n",
        "        times = 99\n",
        ("cli/test_terminal.py::test_ctrl_c_cancels_and_twice_leaves",),
    ),
    Mutant(
        "C6.3",
        "a closed pipe lets the goal run",
        "cli/call/_calling.py",
        "                watch_output(lambda: self._interrupt_soon(Exit.OUTPUT_CLOSED))\n",
        "                pass\n",
        ("cli/test_call.py::test_a_closed_pipe_cancels_the_goal",),
    ),
    Mutant(
        "C6.3",
        "`--ok` and `--transient` decide nothing",
        "cli/call/call.py",
        "    classify = _classifier(ok, transient, action.Result)\n",
        "    classify = None\n",
        ("cli/test_call.py::test_a_call[judged]",),
    ),
    Mutant(
        "C6.3",
        "two servers on a name count as one",
        "_ros/others_goals/server_numbers.py",
        "            if not any(code in _RUNNING for code in latest.values()):\n",
        "            if latest:\n",
        (
            "unit/test_server_numbers.py::"
            "test_one_that_does_not_have_a_running_goal_is_another_server",
        ),
    ),
    Mutant(
        "C6.3",
        "a goal that a second server runs is told as ended, as the first has ended it",
        "_recordings/bag_goals.py",
        "        own = [goal for goal in found if server in (0, goal.server) or not goal.server]\n",
        "        own = found[:1]\n",
        ("recordings/test_real.py::test_a_goal_that_two_servers_have_is_two_goals",),
    ),
    Mutant(
        "C6.3",
        "a refused cancel is told as an agreement",
        "_recordings/bag_goals.py",
        "            if stamp is not None:\n                said = ",
        "            if not data[place]:\n                said = ",
        ("recordings/test_bags.py::test_a_recording_with_service_events_tells_all",),
    ),
    Mutant(
        "C6.3",
        "the end of a cut recording is missing, and nothing says so",
        "_recordings/bag_files.py",
        "                self.problem(path, error)\n",
        "                pass\n",
        ("recordings/test_bags.py::test_what_a_cut_recording_has_is_read",),
    ),
    Mutant(
        "C6.3",
        "what is behind a damaged part of a recording is not read",
        "_recordings/bag_files.py",
        "                except Exception as error:  # noqa: BLE001  the next chunk may be whole\n"
        "                    bag.problem(path, error)\n",
        "                except Exception as error:  # noqa: BLE001  the next chunk may be whole\n"
        "                    return bag.problem(path, error)\n",
        ("recordings/test_bags.py::test_a_chunk_that_is_damaged_hides_no_other",),
    ),
    Mutant(
        "C6.3",
        "times at which goals of one action ran together are not marked",
        "_recordings/pictures/layout.py",
        "        if change > 0 and running == 1:\n",
        "        if change > 0 and running == 2:\n",
        (
            "unit/test_picture.py::"
            "test_calls_are_grouped_by_action_and_times_of_several_goals_are_marked",
        ),
    ),
)

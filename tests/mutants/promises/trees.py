"""Mutants of the leaves of behaviour trees."""

from __future__ import annotations

from tests.mutants.mutant import Mutant

MUTANTS = (
    Mutant(
        "C11.1",
        "a new run does not wait for the earlier goal to stop",
        "trees/_behaviour.py",
        "            if kept := [each for each in earlier if each not in preempted]:\n",
        "            if kept := []:\n",
        (
            "trees/test_leaf_earlier_goal.py::"
            "test_a_new_run_waits_until_the_earlier_goal_has_stopped",
        ),
    ),
    Mutant(
        "C11.1",
        "a goal with an unknown fate holds up no other",
        "trees/_runs.py",
        "        return blocks_another(future, unless_gone=True, unless_unseen=True)\n",
        "        return False\n",
        ("trees/test_leaf_end.py::test_which_earlier_goal_holds_up_a_run",),
    ),
    Mutant(
        "C11.1",
        "a goal that was lost with its server holds up all others for ever",
        "trees/_runs.py",
        "        return blocks_another(future, unless_gone=True, unless_unseen=True)\n",
        "        return blocks_another(future, unless_unseen=True)\n",
        ("trees/test_leaf_end.py::test_which_earlier_goal_holds_up_a_run",),
    ),
    Mutant(
        "C11.1",
        "what a second server has never shown to have holds up all others for ever",
        "trees/_runs.py",
        "unless_gone=True, unless_unseen=True",
        "unless_gone=True",
        ("unit/test_another_goal.py::test_whether_another_goal_may_be_sent",),
    ),
    Mutant(
        "C11.1",
        "a goal counts as stopped while its call may begin another attempt",
        "trees/_runs.py",
        "            return known or None\n",
        "            return known\n",
        (
            "trees/test_leaf_end.py::"
            "test_a_goal_that_stopped_does_not_count_while_its_call_may_send_another",
        ),
    ),
    Mutant(
        "C11.1",
        "`preempt` sends beside a goal of another client, which the server does not stop",
        "trees/_runs.py",
        "        if self.future is None or self._client is not client:\n",
        "        if self.future is None:\n",
        ("trees/test_leaf_end.py::test_only_a_goal_of_the_same_client_is_preempted",),
    ),
    Mutant(
        "C11.1",
        "of two threads that begin a run, neither gives up that of the other",
        "trees/_runs.py",
        "        self._runs.append(run)\n        self.give_up([each for each in list(self._runs)"
        " if each is not run])\n",
        "        self.give_up([each for each in list(self._runs) if each is not run])\n"
        "        self._runs.append(run)\n",
        ("trees/test_leaf_end.py::test_of_two_threads_that_begin_a_run_one_sees_the_other",),
    ),
    Mutant(
        "C11.1",
        "a failed goal is a success of its leaf",
        "trees/_behaviour.py",
        "        if outcome.ok:\n",
        "        if outcome.status.is_terminal:\n",
        ("trees/test_leaf.py::test_failures_say_the_errors_sentence",),
    ),
    Mutant(
        "C11.1",
        "the feedback is not written to the blackboard",
        "trees/_behaviour.py",
        "            self._board.set(self._feedback_key, feedback)\n",
        "            pass\n",
        ("trees/test_leaf.py::test_it_runs_until_its_goal_has_succeeded",),
    ),
    Mutant(
        "C11.1",
        "a tick waits until the goal has ended",
        "trees/_behaviour.py",
        "        done = future.done()  # before reading",
        "        future._wait_until_over(1.0)\n        done = future.done()  # before reading",
        ("trees/test_never_blocks.py::test_no_tick_blocks",),
    ),
    Mutant(
        "C11.1",
        "a leaf waits for ever for news of an earlier goal",
        "trees/_behaviour.py",
        "        elif limit is not None and now >= (run.unknown_since or now) + limit:\n",
        "        elif False:\n",
        (
            "trees/test_leaf_earlier_goal.py::"
            "test_a_goal_that_its_client_lost_touch_with_is_not_run_beside_another",
        ),
    ),
    Mutant(
        "C11.1",
        "a leaf with `fail` waits for the earlier goal",
        "trees/_behaviour.py",
        '        if self._earlier_goal == "fail":\n',
        "        if False:\n",
        ("trees/test_leaf_earlier_goal.py::test_or_it_fails_and_says_so",),
    ),
    Mutant(
        "C11.1",
        "two threads that tick send two goals for one run",
        "trees/_runs.py",
        "            return  # another thread also",
        "            pass  # another thread also",
        ("trees/test_leaf_end.py::test_one_run_sends_one_goal_whoever_ticks",),
    ),
    Mutant(
        "C11.1",
        "a goal that nobody watches any more is known to run",
        "trees/_runs.py",
        "        return known if client_watches or known is False else None",
        "        return known",
        ("trees/test_leaf_end.py::test_of_a_goal_whose_client_was_closed_only_its_end_is_known",),
    ),
    Mutant(
        "C11.2",
        "a leaf that its tree interrupts lets its goal run",
        "trees/_behaviour.py",
        '            self.feedback_message = "interrupted: the server is asked to cancel the goal"'
        "\n        self._runs.give_up()\n",
        '            self.feedback_message = "interrupted: the server is asked to cancel the goal"'
        "\n",
        ("trees/test_interrupting.py::test_a_tree_that_gives_up",),
    ),
    Mutant(
        "C11.2",
        "a run that is given up while it sends its goal lets it run",
        "trees/_runs.py",
        "        if self.unwanted:  # another thread may have set it just now\n"
        "            self.future.cancel()\n",
        "",
        ("trees/test_leaf_end.py::test_a_run_that_was_given_up_sends_nothing",),
    ),
    Mutant(
        "C11.2",
        "a tree that is dropped lets its goals run",
        "trees/_behaviour.py",
        "        weakref.finalize(self, self._runs.close).atexit = False\n",
        "",
        ("trees/test_leaf_end.py::test_a_tree_that_is_dropped_leaves_no_goal_running",),
    ),
    Mutant(
        "C11.2",
        "a shutdown cancels the goals of one leaf only",
        "trees/_behaviour.py",
        "        for leaf in leaves:\n            leaf._runs.close()\n",
        "        self._runs.close()\n",
        ("trees/test_leaf_end.py::test_a_shutdown_cancels_all_goals_first_and_waits_once",),
    ),
    Mutant(
        "C11.2",
        "a leaf that was shut down sends goals",
        "trees/_behaviour.py",
        "        if client is None or self._runs.closed:\n",
        "        if client is None:\n",
        ("trees/test_leaf_end.py::test_a_leaf_that_was_shut_down_sends_nothing",),
    ),
    Mutant(
        "C11.2",
        "a forked process cancels the goals of its parent",
        "trees/_runs.py",
        "        if os.getpid() != self._pid:\n            return  # a forked",
        "        if False:\n            return  # a forked",
        ("trees/test_leaf_end.py::test_a_forked_process_leaves_the_goals_to_its_parent",),
    ),
    Mutant(
        "C11.2",
        "an interrupted start lets its goal run",
        "trees/_runs.py",
        "            self.give_up()\n            raise\n",
        "            raise\n",
        ("trees/test_leaf_end.py::test_a_goal_whose_start_is_interrupted_is_cancelled",),
    ),
)

"""Mutants of how calls fail: one error for each failure, and no success that is none."""

from __future__ import annotations

from tests.mutants.mutant import Mutant

MUTANTS = (
    Mutant(
        "C3.1",
        "the result of a goal that has ended is waited for without end",
        "_goal/record.py",
        "return [fx.Arm(fx.Timer.RESULT, now + limit)]",
        "return []",
        (
            "unit/test_goal_machine.py::test_a_result_that_does_not_follow_its_status_is_asked_for_and_lost_in_the_end",
        ),
    ),
    Mutant(
        "C3.1",
        "a call waits without end for a goal that its server has forgotten",
        "_goal/machine.py",
        'return self._result_lost("its server no longer knows the goal", now)',
        "return []",
        ("unit/test_goal_machine.py::test_a_result_that_is_unknown_after_acceptance_is_lost",),
    ),
    Mutant(
        "C3.1",
        "the empty answer for a goal that the server has forgotten is a success",
        "_ros/codes.py",
        "    GoalStatus.STATUS_ACCEPTED: GoalState.ACCEPTED,\n",
        "    GoalStatus.STATUS_UNKNOWN: GoalState.SUCCEEDED,\n"
        "    GoalStatus.STATUS_ACCEPTED: GoalState.ACCEPTED,\n",
        ("client/test_errors_real.py::test_an_expired_result_is_lost_not_empty",),
    ),
    Mutant(
        "C3.1",
        "a call waits for a server though the name has another type",
        "_calls/machine.py",
        "return self._end(fx.Ending(fx.End.TYPE_MISMATCH, GoalState.SENDING, served=served))",
        "return []",
        (
            "unit/test_call_properties.py::test_a_server_of_another_type_that_is_seen_only_when_time_is_up_is_told",
        ),
    ),
    Mutant(
        "C3.1",
        "a call hangs if the middleware does not take its goal",
        "_calls/machine.py",
        "return self._end(fx.Ending(fx.End.INVALID, GoalState.SENDING, error=error))",
        "return []",
        (
            "unit/test_call_properties.py::test_a_goal_that_the_middleware_does_not_take_is_one_error",
        ),
    ),
    Mutant(
        "C3.1",
        "a call hangs if the communication thread dies",
        "_goal/cancelling.py",
        "return effects + self._settle(fx.End.LOST, error=error) + self._release()",
        "return effects + self._release()",
        ("unit/test_goal_machine.py::test_a_broken_client_ends_the_call",),
    ),
    Mutant(
        "C3.1",
        "a call hangs if its goal is rejected",
        "_goal/machine.py",
        "        return effects + self._end_here(end, now)\n",
        "        return effects\n",
        ("unit/test_goal_machine.py::test_a_goal_is_rejected",),
    ),
    Mutant(
        "C3.2",
        "an error does not keep its cause",
        "_calls/explain.py",
        "        error.__cause__ = ending.error\n",
        "        pass\n",
        ("unit/test_explain.py::test_the_facts_of_each_error",),
    ),
    Mutant(
        "C3.2",
        "a pickled error loses its cause",
        "_model/errors.py",
        'state = {**self.__dict__, "__cause__": _picklable(self.__cause__)}',
        "state = {**self.__dict__}",
        ("unit/test_errors.py::test_an_error_travels_between_processes_with_all_it_knows",),
    ),
    Mutant(
        "C3.2",
        "servers of a similar name are not told",
        "_calls/graph_snapshot.py",
        "    close = similar_names(action_name, sorted(actions))\n",
        "    close: list[str] = []\n",
        ("unit/test_explain.py::test_without_a_server_the_text_tells_what_is_seen",),
    ),
    Mutant(
        "C3.2",
        "the error for another type does not say which types are served",
        "_calls/explain.py",
        "        error.served = ending.served\n",
        "        pass\n",
        ("unit/test_explain.py::test_the_facts_of_each_error",),
    ),
    Mutant(
        "C3.2",
        "an error does not say after how long it happened",
        "_calls/explain.py",
        '        "elapsed": call.elapsed,\n',
        "",
        ("unit/test_explain.py::test_an_error_tells_what_happened_to_which_action_and_what_to_do",),
    ),
    Mutant(
        "C3.3",
        "`classify=` makes a success of a goal that was rejected or canceled",
        "_calls/classify.py",
        "        if verdict is Verdict.SUCCESS and lack:\n",
        "        if verdict is Verdict.SUCCESS and not outcome:\n",
        ("unit/test_classify.py::test_what_can_be_judged_a_success",),
    ),
    Mutant(
        "C3.3",
        "a success stays one where `classify=` raises",
        "_calls/classify.py",
        'return Fault(f"{label_of(classify)} raised {described(error)}", error)',
        "return default_verdict(outcome)",
        ("unit/test_classify.py::test_a_function_that_raises_gives_no_verdict",),
    ),
    Mutant(
        "C3.3",
        "a success stays one where `classify=` gives no valid answer",
        "_calls/classify.py",
        "failed = succeeded or verdict.impossible",
        "failed = verdict.impossible",
        ("unit/test_classify.py::test_without_a_verdict_nothing_is_a_success",),
    ),
    Mutant(
        "C3.3",
        "a success stays one where `classify=` does not answer",
        "_calls/classify_runner.py",
        'verdict = Fault(f"{label} {verdict.why}", asked=verdict.asked)',
        "verdict = default_verdict(outcome)",
        (
            "unit/test_call_properties.py::test_a_function_that_does_not_answer_makes_no_success_and_holds_nothing_up",
        ),
    ),
)

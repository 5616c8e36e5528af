"""Mutants of trying again: when another goal is sent, and when none may be."""

from __future__ import annotations

from tests.mutants.mutant import Mutant

MUTANTS = (
    Mutant(
        "C4.1",
        "a call sends one goal more than its policy allows",
        "_calls/retry.py",
        "tenacity.stop_after_attempt(policy.attempts)",
        "tenacity.stop_after_attempt(policy.attempts + 1)",
        ("unit/test_retry.py::test_attempts_include_the_first",),
    ),
    Mutant(
        "C4.1",
        "a call is tried four times by default",
        "_model/settings.py",
        "attempts: int = 3\n",
        "attempts: int = 4\n",
        ("unit/test_settings.py::test_the_defaults_are_those_of_the_contract",),
    ),
    Mutant(
        "C4.1",
        "a pause is begun that ends after the deadline",
        "_calls/retry_runner.py",
        "too_late = deadline is not None and now() + pause >= deadline",
        "too_late = False",
        ("unit/test_retry.py::test_a_pause_that_would_cross_the_deadline_is_not_begun",),
    ),
    Mutant(
        "C4.1",
        "the error does not say which limit ended the retries",
        "_calls/machine.py",
        "return self._end(replace(ending, not_retried=waited + plan.reason))",
        "return self._end(ending)",
        (
            "unit/test_call_properties.py::"
            "test_attempts_end_with_the_last_error_and_the_limit_that_ended_them",
        ),
    ),
    Mutant(
        "C4.1",
        "a permanent failure is tried again",
        "_calls/classify.py",
        "return Verdict.TRANSIENT if transient else Verdict.PERMANENT",
        "return Verdict.TRANSIENT",
        ("unit/test_classify.py::test_each_error_says_whether_trying_again_may_help",),
    ),
    Mutant(
        "C4.2",
        "a goal is sent again that may run",
        "_calls/machine.py",
        "return all(self._allows_another(earlier) for earlier in self.earlier)",
        "return True",
        ("unit/test_call_properties.py::test_subtle_orders",),
    ),
    Mutant(
        "C4.2",
        "the silence of a server lets another goal be sent",
        "_goal/facts.py",
        "return self.lost and self.gone and not self.left",
        "return self.lost and not self.left",
        ("unit/test_call_properties.py::test_it_is_waited_for_until_the_deadline",),
    ),
    Mutant(
        "C4.2",
        "by default a goal is sent again when its server is gone",
        "_calls/retry.py",
        '(news is LastNews.SERVER_GONE and resend == "server_gone")',
        "news is LastNews.SERVER_GONE",
        ("unit/test_retry.py::test_whether_a_goal_is_sent_again",),
    ),
    Mutant(
        "C4.2",
        "the most careful policy sends a goal again that may have been accepted",
        "_calls/retry.py",
        '    if resend == "never_accepted":\n        return False',
        '    if resend == "never_accepted" and not news:\n        return False',
        ("unit/test_retry.py::test_whether_a_goal_is_sent_again",),
    ),
    Mutant(
        "C4.2",
        "what one of two servers has ended is sent again, though the other may run it",
        "_goal/machine.py",
        "facts.over = self._stopped_everywhere(everybody=everybody)",
        "facts.over = True",
        (
            "client/test_two_servers.py::"
            "test_what_one_server_aborts_is_not_sent_again_while_another_may_run_it",
        ),
    ),
    Mutant(
        "C4.2",
        "what one of two servers has rejected is sent again, though the other may run it",
        "_goal/facts.py",
        "return self.over or not (self.accepted or self.noes < self.servers)",
        "return self.over or not (self.accepted or self.noes < 1)",
        (
            "unit/test_goal_machine.py::"
            "test_what_one_of_two_servers_rejects_after_both_were_lost_is_still_followed",
        ),
    ),
    Mutant(
        "C4.3",
        "lost goals are not asked about before another one is sent",
        "_calls/call.py",
        "            if earlier.goal.stage is Stage.LOST and self._session.server_is_ready():\n",
        "            if earlier.goal.stage is Stage.OVER and self._session.server_is_ready():\n",
        (
            "unit/test_call_properties.py::"
            "test_a_goal_of_a_server_that_fell_silent_is_asked_about_when_the_call_goes_on",
        ),
    ),
    Mutant(
        "C4.3",
        "a late success is not taken, and the goal is sent again",
        "_calls/machine.py",
        "        if attempt not in self.earlier or self.attempt is not None:\n",
        "        if attempt in self.earlier or self.attempt is not None:\n",
        ("unit/test_call_properties.py::test_a_late_success_is_taken_in_place_of_another_goal",),
    ),
    Mutant(
        "C4.3",
        "a goal is sent again while the result of an earlier one is on its way",
        "_calls/machine.py",
        "ended_as = earlier.goal.awaits_result_of",
        "ended_as = None",
        (
            "unit/test_call_properties.py::"
            "test_no_goal_is_sent_while_the_success_of_an_earlier_one_is_on_its_way",
        ),
    ),
    Mutant(
        "C4.4",
        "a goal that somebody else has cancelled is tried again",
        "_calls/machine.py",
        "if verdict is not Verdict.TRANSIENT or ending.end is fx.End.CANCELED_BY_OTHER:",
        "if verdict is not Verdict.TRANSIENT:",
        ("unit/test_call_properties.py::test_subtle_orders",),
    ),
    Mutant(
        "C4.4",
        "a goal that somebody else was cancelling is tried again if it ends in another way",
        "_calls/machine.py",
        "        if self.goals.others_cancel:\n",
        "        if self.goals.others_cancel and self.unwanted:\n",
        ("unit/test_call_properties.py::test_subtle_orders",),
    ),
    Mutant(
        "C4.4",
        "a goal stalls while somebody else cancels it",
        "_goal/record.py",
        "quiet = self._terminal_seen is not None or self.facts.others_cancel",
        "quiet = self._terminal_seen is not None",
        ("unit/test_goal_machine.py::test_silence_is_no_stall_while_somebody_else_cancels",),
    ),
    Mutant(
        "C4.4",
        "each cancel counts as ours if this client has asked for one, too",
        "_calls/attempt.py",
        "return self._cancels > 0",
        "return self._first_cancel_at > 0",
        ("unit/test_call_properties.py::test_subtle_orders",),
    ),
    Mutant(
        "C4.4",
        "nobody looks in a goal's first second whether somebody else cancels it",
        "_calls/session.py",
        "made.goal.watched_early = may_fail_for_now and tries_again",
        "made.goal.watched_early = False",
        ("unit/test_session.py::test_what_may_be_sent_again_is_watched_from_the_beginning",),
    ),
    Mutant(
        "C4.5",
        "a budget is never used up",
        "_calls/budget.py",
        "self._change(-1.0)",
        "self._change(0.0)",
        (
            "unit/test_budget.py::"
            "test_a_server_that_fails_for_everybody_is_soon_left_alone_and_tried_again_later",
        ),
    ),
    Mutant(
        "C4.5",
        "calls are tried again though the budget forbids it",
        "_calls/retry.py",
        "    if not budget.allows_retry:\n",
        "    if not budget:\n",
        ("unit/test_call_properties.py::test_the_budget_forbids_retries_and_counts_each_call",),
    ),
    Mutant(
        "C4.5",
        "failures do not count against the budget",
        "_calls/call.py",
        "(budget.on_success if effect.success else budget.on_transient_failure)()",
        "budget.on_success()",
        ("unit/test_call_properties.py::test_the_budget_forbids_retries_and_counts_each_call",),
    ),
)

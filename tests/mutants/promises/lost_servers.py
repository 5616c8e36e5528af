"""Mutants of losing a server, and of taking a server for lost that is not."""

from __future__ import annotations

from tests.mutants.mutant import Mutant

MUTANTS = (
    Mutant(
        "C5.1",
        "a goal is not lost with its server",
        "_ros/servers/monitor.py",
        "            self._lose(listener, goal, gone, reason)\n",
        "            pass\n",
        ("unit/test_monitor.py::test_goals_are_lost_with_the_last_server_that_may_have_them",),
    ),
    Mutant(
        "C5.1",
        "a call waits on though its goal was lost with its server",
        "_goal/machine.py",
        "        effects += self._settle(fx.End.LOST, lost_because=reason)\n",
        "",
        (
            "unit/test_goal_machine.py::"
            "test_a_lost_server_ends_the_call_and_a_goal_that_comes_back_is_cancelled",
        ),
    ),
    Mutant(
        "C5.2",
        "a restart is never noticed",
        "_ros/servers/restarts.py",
        "if max(self._answers.values(), default=0) == 1:",
        "if max(self._answers.values(), default=0) == 0:",
        ("unit/test_restarts.py::test_what_the_answers_tell",),
    ),
    Mutant(
        "C5.2",
        "the goals of a server that was restarted are not told so",
        "_ros/servers/monitor.py",
        "                self._lose(listener, goal, replaced, SEEMS_REPLACED)\n",
        "",
        (
            "unit/test_monitor.py::"
            "test_a_silent_server_with_a_successor_on_a_node_of_its_name_was_restarted",
        ),
    ),
    Mutant(
        "C5.2",
        "nobody looks for a restart when one of two servers does not know a goal",
        "_ros/link.py",
        """            # the goal is dead (R1).
            self.monitor.restarts.start()""",
        "            # the goal is dead (R1).",
        ("unit/test_link.py::test_of_two_servers_one_that_does_not_know_a_goal_proves_nothing",),
    ),
    Mutant(
        "C5.3",
        "a node that only publishes feedback counts as a server",
        "_ros/servers/readiness.py",
        "self._not_serving = frozenset(end.gid for end in ours if not end.serves)",
        "self._not_serving = frozenset()",
        ("unit/test_readiness.py::test_a_player_is_no_server",),
    ),
    Mutant(
        "C5.3",
        "nobody looks again where the graph shows later than the event who has gone",
        "_ros/servers/readiness.py",
        "        self._compare_later(_FIRST_STEP, self._matched_at)\n",
        "",
        ("unit/test_readiness.py::test_a_graph_that_is_behind_when_a_server_goes",),
    ),
    Mutant(
        "C5.4",
        "a process that was stopped believes at once that its server is gone",
        "_ros/workarounds/standstill.py",
        "            self._believe_no_loss(BELIEVED_AFTER)\n",
        "",
        (
            "unit/test_standstill.py::"
            "test_no_loss_is_believed_for_a_while_and_results_are_asked_for",
        ),
    ),
    Mutant(
        "C5.4",
        "a server that is out of sight for a moment after a standstill is gone",
        "_ros/servers/monitor.py",
        "held = self._timers.now() < self._held_until",
        "held = False",
        (
            "unit/test_monitor.py::"
            "test_a_server_that_is_back_soon_after_a_standstill_was_never_gone",
        ),
    ),
    Mutant(
        "C5.4",
        "a server that stays away after a standstill is never gone",
        "_ros/servers/monitor.py",
        "            self._tell_who_has_them()\n            self._lose_all(gone)",
        "            self._tell_who_has_them()",
        ("unit/test_monitor.py::test_one_that_stays_away_after_a_standstill_is_gone",),
    ),
    Mutant(
        "C5.4",
        "results that came during a standstill are not asked for again",
        "_ros/workarounds/standstill.py",
        "                link.ask_about_goals()\n",
        "                pass\n",
        (
            "unit/test_standstill.py::"
            "test_no_loss_is_believed_for_a_while_and_results_are_asked_for",
        ),
    ),
    Mutant(
        "C5.4",
        "a node that no server finds again is not replaced",
        "_ros/workarounds/standstill.py",
        "            self._replace_node()\n",
        "",
        ("unit/test_standstill.py::test_where_no_server_answers_the_node_is_replaced_once",),
    ),
    Mutant(
        "C5.5",
        "a server that answers nothing for some seconds is lost by default",
        "_model/settings.py",
        "liveness: float | None = None\n",
        "liveness: float | None = 2.0\n",
        ("unit/test_settings.py::test_the_defaults_are_those_of_the_contract",),
    ),
    Mutant(
        "C5.5",
        "a busy server is taken for restarted because another one answers",
        "_ros/servers/monitor.py",
        "replaced = frozenset(gid for gid in goal.servers if nodes.get(gid) in newer)",
        "replaced = goal.servers if newer else frozenset()",
        ("unit/test_monitor.py::test_a_server_that_may_live_is_not_taken_for_restarted",),
    ),
    Mutant(
        "C5.5",
        "a server that is too busy to answer never gets a goal",
        "_ros/servers/readiness.py",
        "            self._become_ready()\n            return\n",
        "            return\n",
        ("unit/test_readiness.py::test_a_server_that_answers_nothing_is_busy_not_deaf",),
    ),
    Mutant(
        "C5.6",
        "two servers on one name are warned of again and again",
        "_ros/servers/monitor.py",
        "            self._warned = True\n",
        "",
        ("unit/test_monitor.py::test_several_servers_are_warned_of_once_with_their_nodes",),
    ),
    Mutant(
        "C5.6",
        "two servers on one name are not warned of",
        "_ros/servers/monitor.py",
        "self._timers.call_at(self._timers.now() + _NAMING, self._warn_of_several)",
        "pass",
        ("unit/test_monitor.py::test_several_servers_are_warned_of_once_with_their_nodes",),
    ),
    Mutant(
        "C5.6",
        "a call ends once more with the answer of the second server",
        "_goal/record.py",
        """        if self.settled:
            return []
        self.settled = True""",
        "        self.settled = True",
        ("unit/test_goal_machine.py",),
    ),
    Mutant(
        "C5.7",
        "a server that never had the goal can say by its result that it is lost",
        "_goal/machine.py",
        "return self._forgotten(now, asked_at) if own else []",
        "return self._forgotten(now, asked_at)",
        ("unit/test_goal_given_up.py::test_what_another_server_does_not_know_may_run_on_its_own",),
    ),
    Mutant(
        "C5.7",
        "a server that never had the goal can say that there is nothing to cancel",
        "_goal/machine.py",
        "forgets = own and self._terminal_seen is None",
        "forgets = self._terminal_seen is None",
        ("unit/test_goal_given_up.py::test_what_another_server_does_not_know_may_run_on_its_own",),
    ),
    Mutant(
        "C5.7",
        "a lost goal is over when another server has no result of it",
        "_goal/machine.py",
        "return self._unknown_to_another() if facts.lost else self._over()",
        "return self._over()",
        (
            "unit/test_goal_machine.py::"
            "test_a_lost_goal_is_forgotten_when_its_own_server_does_not_know_it",
        ),
    ),
    Mutant(
        "C5.7",
        "a lost goal is over when another server cannot cancel it",
        "_goal/machine.py",
        "return self._unknown_to_another() if self.facts.lost else self._over()",
        "return self._over()",
        (
            "unit/test_goal_machine.py::"
            "test_a_lost_goal_is_forgotten_when_its_own_server_does_not_know_it",
        ),
    ),
    Mutant(
        "C5.7",
        "the successor of a restarted server speaks for it",
        "_ros/servers/monitor.py",
        "                goal.sent_to -= replaced\n",
        "",
        (
            "unit/test_monitor.py::"
            "test_a_silent_server_with_a_successor_on_a_node_of_its_name_was_restarted",
        ),
    ),
    Mutant(
        "C5.7",
        "each server that is ready counts as the one that has the goal",
        "_calls/attempt.py",
        "back = self._link.sees_server_of(self) and not (facts.servers > 1 and facts.away)",
        "back = not (facts.servers > 1 and facts.away)",
        ("unit/test_call_properties.py::test_subtle_orders",),
    ),
)

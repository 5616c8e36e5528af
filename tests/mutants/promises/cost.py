"""Mutants of what calls cost."""

from __future__ import annotations

from tests.mutants.mutant import Mutant

MUTANTS = (
    Mutant(
        "C7.2",
        "the status topic is read a hundred times a second",
        "_ros/answers/status.py",
        "_PERIOD = 0.1\n",
        "_PERIOD = 0.01\n",
        ("unit/test_status_topic.py::test_a_busy_server_is_read_ten_times_a_second",),
    ),
    Mutant(
        "C7.2",
        "the status topic is read at each change",
        "_ros/answers/status.py",
        "        self._runtime.disable(self._source)\n        self._pause = ",
        "        self._pause = ",
        ("test_cost_shape.py::test_status_is_read_ten_times_a_second_at_most",),
    ),
    Mutant(
        "C7.2",
        "feedback is decoded that nobody looks at",
        "_calls/sending/call_record.py",
        "        goal_id = attempt.goal_id\n",
        "        [one() for one in handful]\n        goal_id = attempt.goal_id\n",
        ("test_cost_shape.py::test_nobody_elses_feedback_is_decoded",),
    ),
    Mutant(
        "C7.2",
        "requests of calls that are over are kept",
        "_ros/sending/requests.py",
        "        for what, seq in self._made.pop(key, ()):\n",
        "        for what, seq in self._made.get(key, ()):\n",
        ("test_cost_shape.py::test_nothing_is_left_of_calls_that_are_over",),
    ),
    Mutant(
        "C7.3",
        "feedback that the result has overtaken is lost",
        "_ros/sending/link.py",
        "        self._feedback.take_all()  # the result may have overtaken some feedback (R15)\n",
        "",
        ("unit/test_link.py::test_what_a_server_said_before_it_went_is_read_first",),
    ),
    Mutant(
        "C7.4",
        "an idle client wakes up a hundred times a second beside others' feedback",
        "_ros/answers/feedback.py",
        "_PAUSE_WHEN_IDLE = 1.0\n",
        "_PAUSE_WHEN_IDLE = 0.01\n",
        ("unit/test_feedback_topic.py::test_others_feedback_wakes_an_idle_client_once_a_second",),
    ),
    Mutant(
        "C7.4",
        "a call that waits for a server looks for it ten times a second",
        "_ros/servers_in_sight/readiness.py",
        "_GRAPH_PERIOD = 1.0\n",
        "_GRAPH_PERIOD = 0.1\n",
        ("test_cost_shape.py::test_who_waits_for_a_server_is_woken_once_a_second",),
    ),
    Mutant(
        "C7.4",
        "a main thread that waits wakes up twenty times a second",
        "_threads/waiting.py",
        "_SLICE = 0.5\n",
        "_SLICE = 0.05\n",
        ("unit/test_waiting.py::test_the_main_thread_never_waits_for_ever_at_once",),
    ),
    Mutant(
        "C7.4",
        "answers that nobody waits for are waited for",
        "_ros/sending/requests.py",
        "            self._runtime.disable(source)\n",
        "            pass\n",
        (
            "unit/test_requests.py::test_late_acceptances_are_waited_for_where_there_are_several_servers",
        ),
    ),
    Mutant(
        "C7.5",
        "timers that were cancelled are kept until they are due",
        "_threads/clock.py",
        "        if len(self._heap) > 2 * self._live + _SLACK:\n",
        "        if len(self._heap) > 2 * self._live + 1000 * _SLACK:\n",
        ("unit/test_clock.py::test_far_deadlines_that_were_cancelled_are_not_kept",),
    ),
    Mutant(
        "C7.5",
        "goals that failed stay in a table",
        "_ros/sending/link.py",
        "        if self._listeners.pop(key, None) is None:\n",
        "        if self._listeners.get(key) is None:\n",
        ("test_cost_shape.py::test_nothing_is_left_of_calls_that_failed",),
    ),
    Mutant(
        "C7.6",
        "a fresh process that sees no server does not try again",
        "_ros/workarounds/node_replacement.py",
        "        if self.links and self._can_leave(len(self.links)):\n",
        "        if False:\n",
        (
            "unit/test_rejoining.py::"
            "test_who_sees_no_server_enters_the_graph_anew_twice_and_no_more",
        ),
    ),
    Mutant(
        "C7.6",
        "the node is replaced although a server was seen, so a goal may be lost",
        "_ros/workarounds/node_replacement.py",
        "        if any(link.has_seen_servers() for link in self.links):\n            return\n",
        "",
        ("unit/test_rejoining.py::test_who_has_seen_a_server_stays_for_good",),
    ),
    Mutant(
        "C7.6",
        "the second try cannot be switched off",
        "_ros/workarounds/node_replacement.py",
        '    return os.environ.get(SWITCH, "").strip() != "0"\n',
        "    return True\n",
        ("client/test_rejoining_real.py::test_the_switch_leaves_one_node",),
    ),
    Mutant(
        "C7.6",
        "the node of a client with `node=` is replaced beside the user's nodes",
        "_ros/communication/runtime.py",
        "        if self._owns_participant:\n            self.node_replacement.joined",
        "        if True:\n            self.node_replacement.joined",
        ("client/test_rejoining_real.py::test_in_a_context_of_the_users_there_is_no_second_try",),
    ),
)

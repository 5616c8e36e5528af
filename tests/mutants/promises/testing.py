"""Mutants of what tests of one's own robot use."""

from __future__ import annotations

from tests.mutants.mutant import Mutant

MUTANTS = (
    Mutant(
        "C9.1",
        "each goal meets the first entry of the script",
        "testing/_fake_plans.py",
        "            return self._next.popleft() if self._next",
        "            return self._next[0] if self._next",
        ("fake_server/test_fake_server.py::test_a_script_then_the_settings",),
    ),
    Mutant(
        "C9.1",
        "a refused cancel is accepted",
        "testing/_fake_behaviour.py",
        '        return bool(answer != "refuse")\n',
        "        return True\n",
        ("fake_server/test_fake_server.py::test_cancels_by_a_plain_client",),
    ),
    Mutant(
        "C9.1",
        "what a function of the test raises passes unseen",
        "testing/_fake_server.py",
        "            self._errors.append(error)\n",
        "            pass\n",
        ("fake_server/test_fake_server_errors.py::test_what_a_function_raises_shows_in_the_test",),
    ),
    Mutant(
        "C9.1",
        "a new goal runs beside the one that it replaces",
        "testing/_fake_behaviour.py",
        "                run.earlier = frozenset(self._running)\n",
        "                run.earlier = frozenset()\n",
        (
            "fake_server/test_fake_server_preempts.py::"
            "test_a_goal_that_cannot_be_cancelled_is_preempted",
        ),
    ),
    Mutant(
        "C9.1",
        "clients see the server only some time after it has started",
        "testing/_fake_server.py",
        "                self._await_clients(domain)\n",
        "",
        ("fake_server/test_fake_server_in_view.py::test_a_new_client_sees_the_server_at_once",),
    ),
    Mutant(
        "C9.1",
        "a server goes on after its end",
        "testing/_fake_server.py",
        "                ended = harness.stop(_STOP_TIMEOUT)\n",
        "                ended = True\n",
        ("fake_server/test_fake_server_life.py::test_many_in_a_row_leave_nothing",),
    ),
    Mutant(
        "C9.1",
        "a function of the test is asked anew for each repeated request",
        "testing/_fake_behaviour.py",
        "        if run.goal_id not in self._entries:\n",
        "        if True:\n",
        ("fake_server/test_fake_server_errors.py::test_a_request_that_is_sent_again",),
    ),
    Mutant(
        "C9.1",
        "a wrong setting passes until a goal comes",
        "testing/_fake_plans.py",
        '            merged[name] = checked(self.action, name, value, f"{where}.{name}")\n',
        "            merged[name] = value\n",
        ("fake_server/test_fake_server.py::test_wrong_scripts",),
    ),
)

"""What is held on each combination of servers and middleware, and by which tests."""

from __future__ import annotations

from tests.field.promises import KEYS
from tests.tables import Page

CPP = "cpp"
CYCLONE = "cyclonedds"
COMBINATIONS = (f"{CPP}-fastdds", f"python-{CYCLONE}", f"{CPP}-{CYCLONE}")
"""Servers and middleware. Without the option, they are in Python, and it is Fast DDS."""
PROMISES: dict[str, tuple[str, ...]] = {
    "Calls: blocking, as a future, awaited": (
        "client/test_call.py::test_a_call_returns_the_result",
        "client/test_call.py::test_a_future_shows_the_goal_live",
    ),
    "Errors say what happened": (
        "client/test_errors_real.py::test_an_expired_result_is_lost_not_empty",
        "client/test_errors_real.py::test_the_results_of_failures_are_kept",
        "client/test_errors_real.py::test_a_late_success_is_not_thrown_away",
    ),
    "Cancelling, and goals that their caller has given up on": (
        "client/test_cancel.py::test_cancel_while_it_runs",
        "client/test_cancel.py::test_a_refused_cancel_leaves_the_goal_to_wait_for",
        "client/test_cancel.py::test_a_cancel_that_is_not_confirmed_ends_the_call",
        "client/test_cancel.py::test_late_acceptance_after_the_deadline_is_cancelled",
        "client/test_cancel.py::test_closing_settles_what_is_in_flight",
    ),
    "Goals of other clients: followed, and cancelled": (
        "client/test_attach.py::test_it_follows_a_goal_to_its_end",
        "client/test_attach.py::test_everything_is_cancelled_also_what_others_have_sent",
        "client/test_attach.py::test_what_refuses_is_told_and_followed_no_more",
    ),
    "Goals of a recording, afterwards": (
        "recordings/test_real.py::test_a_recording_tells_what_happened_to_each_goal",
        "recordings/test_real.py::test_a_goal_that_two_servers_have_is_two_goals",
    ),
    "Many goals at once": (
        "client/test_many.py::test_500_goals_at_once_from_8_threads",
        "client/test_many.py::test_clients_of_one_process_share_the_queue_of_the_server",
    ),
    "Retries, and nothing twice that may still run": (
        "client/test_retry_real.py::test_permanent_failures_are_not",
        "client/test_retry_real.py::test_a_server_that_takes_long_to_accept_runs_the_goal_once",
        "client/test_retry_real.py::test_a_restarted_server_gets_the_goal_again",
        "client/test_retry_real.py::test_a_killed_and_restarted_server_is_noticed",
        "client/test_retry_real.py::test_a_stalled_goal_is_stopped_before_another_is_sent",
        "client/test_retry_real.py::test_nothing_is_sent_again_while_the_first_may_run",
    ),
    "A server that is lost": (
        "client/test_errors_real.py::test_a_server_is_said_to_be_lost_when_it_was",
        "client/test_retry_real.py::test_liveness_notices_a_stopped_server",
        "client/test_attach.py::test_a_server_that_ends_is_noticed",
    ),
    "Feedback": (
        "client/test_feedback_real.py::test_callbacks_get_it_unwrapped_and_in_order",
        "client/test_feedback_real.py::test_feedback_of_others_is_not_ours",
        "client/test_feedback_real.py::test_iterating_ends_when_the_goal_ends",
    ),
    "Ctrl-C, SIGTERM, and the end of a program": (
        "client/test_interrupt.py::test_ctrl_c_in_a_blocking_call",
        "client/test_interrupt.py::test_a_second_ctrl_c_does_not_wait",
        "client/test_interrupt.py::test_signals_under_asyncio_cancel_the_goal",
        "client/test_exit.py::test_exit",
        "client/test_exit.py::test_a_handler_of_sigterm_leaves_no_goal_running",
        "faults/test_killed.py::test_a_killed_program_leaves_no_goal_running"
        "[the next start: `ledger.cancel()`, executing]",
    ),
    "Coroutines of asyncio, Trio and rclpy": (
        "client/test_asyncio.py::test_gather",
        "client/test_asyncio.py::test_cancelling_the_task_cancels_the_goal",
        "client/test_asyncio.py::test_asyncio_timeout",
        "awaiting/test_asyncio_forms.py::test_two_tasks",
        "awaiting/test_anyio_trio_forms.py::test_trio",
        "awaiting/test_rclpy_forms.py::test_execute_callback",
    ),
    "Trees": (
        "trees/test_leaf.py::test_it_runs_until_its_goal_has_succeeded",
        "trees/test_leaf_end.py::test_a_run_that_was_given_up_sends_nothing",
    ),
    "Secured graphs (SROS 2), with CycloneDDS": ("native/test_security.py",),
    "The command line": (
        "cli/test_call.py::test_sigterm_is_as_ctrl_c",
        "cli/test_call.py::test_a_closed_pipe_cancels_the_goal",
        "cli/test_call.py::test_json_tells_every_state_in_order_and_the_outcome_last",
        "cli/test_cancel.py::test_a_refusal_is_told",
        "cli/test_stop.py::test_the_goals_of_three_servers",
    ),
}
"""Files of tests, tests, and variants of tests, in `tests/`."""
TABLE = "promises"
PAGE = Page("where-it-runs.md", {TABLE: [(row,) for row in PROMISES], **KEYS})


def row_of(node_id: str) -> str | None:
    """Return the promise that a test holds on each combination, if any."""
    variant = node_id.removeprefix("tests/")
    test, file = variant.partition("[")[0], variant.partition("::")[0]
    return next((row for row, tests in PROMISES.items() if {variant, test, file} & {*tests}), None)


def is_named(variant: str) -> bool:
    """Return whether just this variant of a test is listed."""
    name = variant.removeprefix("tests/")
    return "[" in name and any(name in tests for tests in PROMISES.values())


def files() -> list[str]:
    """Return the files with these tests."""
    named = (test.partition("::")[0] for tests in PROMISES.values() for test in tests)
    return [f"tests/{name}" for name in dict.fromkeys(named)]

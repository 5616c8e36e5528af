"""The exit codes of the command line, in one table; the documentation shows the same table."""

from __future__ import annotations

from enum import IntEnum
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from actionkit import Outcome


class Exit(IntEnum):
    """The exit codes of the command `actionkit`; `meaning` is for people."""

    meaning: str

    OK = 0, "It came out as it should; of `call`: the goal succeeded."
    FAILED = 1, "It did not come out as it should, and no other code says how."
    USAGE = 2, "A wrong command, option or argument, goals and types included; nothing was sent."
    NO_ROS = 3, "rclpy, or a message package that is needed, cannot be imported."
    REJECTED = 10, "The server rejected the goal; it never ran."
    ABORTED = 11, "The server aborted the goal."
    CANCELED = 12, "Somebody else cancelled the goal."
    TIMED_OUT = 13, "The time of --timeout ran out, and there was a server; the goal was cancelled."
    NO_SERVER = 14, "No server was ready in the time there was; nothing was sent."
    SERVER_LOST = (
        15,
        "The server went away, or seems restarted, with the goal in flight, which may still be"
        " running.",
    )
    TYPE_MISMATCH = 16, "The action is served with another type; nothing was sent."
    RESULT_LOST = 17, "The goal ended, but its result cannot be had."
    NO_ANSWER = (
        18,
        "The server neither accepted nor rejected the goal in time; the error says whether it may"
        " still be running.",
    )
    STALLED = 19, "No feedback for --feedback-timeout seconds; the goal was cancelled."
    JUDGED = 20, "The goal succeeded, but not by --ok or --transient, or it lacks their field."
    RETRIES_EXHAUSTED = 21, "The same, and the retries of --retries ended."
    CANCEL_REFUSED = (
        22,
        "A server refused to cancel a goal, which is still running. Of `call`: also if other things"
        " went wrong, but not after Ctrl-C or a signal.",
    )
    CANCEL_UNKNOWN = (
        23,
        "A goal may still be running: its end was not seen. Of `call`: also if it succeeded on one"
        " of two servers, or other things went wrong, but not after Ctrl-C or a signal, and not"
        " with codes 15 and 18.",
    )
    NO_SUCH_GOAL = 24, "Of `cancel` and `attach`: no server in sight knows a goal of that id."
    HELD = (
        25,
        "Of `stop --status`: a human has stopped the robot, and agents send no goals. Of `stop"
        " --release`: somebody has stopped it again meanwhile.",
    )
    NOT_EXECUTABLE = 126, "Of `guard`: the program cannot be run."
    NOT_FOUND = 127, "Of `guard`: the program is not there."
    HANGUP = 129, "The terminal was closed; as after Ctrl-C."
    INTERRUPTED = 130, "Ctrl-C. The output says what happened to the goal; it may still be running."
    OUTPUT_CLOSED = (
        141,
        "The reader of the output ended, as `| head -1` does, or it cannot be written, as to a full"
        " disk; as after Ctrl-C.",
    )
    TERMINATED = 143, "SIGTERM; as after Ctrl-C."

    def __new__(cls, code: int, meaning: str) -> Exit:
        member = int.__new__(cls, code)
        member._value_ = code
        member.meaning = meaning
        return member


_OF_ERRORS = (
    # The first one that fits counts.
    ("InvalidGoalError", Exit.USAGE),
    ("GoalUnknownError", Exit.NO_SUCH_GOAL),
    ("GoalRejectedError", Exit.REJECTED),
    ("GoalAbortedError", Exit.ABORTED),
    ("GoalCanceledError", Exit.CANCELED),
    ("DeadlineExceededError", Exit.TIMED_OUT),
    ("ServerUnavailableError", Exit.NO_SERVER),
    ("ServerLostError", Exit.SERVER_LOST),
    ("ActionTypeMismatchError", Exit.TYPE_MISMATCH),
    ("ResultLostError", Exit.RESULT_LOST),
    ("AcceptanceTimeoutError", Exit.NO_ANSWER),
    ("FeedbackStalledError", Exit.STALLED),
    ("RetriesExhaustedError", Exit.RETRIES_EXHAUSTED),
    ("PermanentError", Exit.JUDGED),
)
_MAY_RUN = {"REFUSED": Exit.CANCEL_REFUSED, "UNKNOWN": Exit.CANCEL_UNKNOWN}


def ended_without_result(outcome: Outcome[Any]) -> str | None:
    """Return how a goal ended if only its result did not come, else `None`."""
    status = getattr(outcome.error, "status", None)
    late = getattr(outcome.error, "late_result", None)
    return str(status) if status in ("SUCCEEDED", "ABORTED") and late is None else None


def exit_of(outcome: Outcome[Any]) -> Exit:
    """Return the exit code for a call that nobody interrupted."""
    code = Exit.OK if outcome.error is None else _of_error(outcome)
    if code in (Exit.SERVER_LOST, Exit.NO_ANSWER):  # these say that the goal may run
        return code
    return _MAY_RUN.get(str(outcome.cancel), code)


def _of_error(outcome: Outcome[Any]) -> Exit:
    if ended_without_result(outcome) is not None:
        return Exit.RESULT_LOST  # even if a time limit ended the wait for it
    names = [cls.__name__ for cls in type(outcome.error).__mro__]
    return next((code for name, code in _OF_ERRORS if name in names), Exit.FAILED)

"""Sentences about goals that may still run, and about those that were cancelled (C2.8)."""

from __future__ import annotations

from collections.abc import Iterable

from actionkit._calls.errors.error_context import ErrorContext
from actionkit._goal.effects import Ending, LastNews
from actionkit._model.values import CancelReport, GoalFate, GoalReport, GoalState

_NAMED = 10
"""How many goals an error names; `Outcome.goals` has all."""
_WHY_IT_MAY_RUN = {
    GoalFate.UNANSWERED: "the server has not answered, and may accept it yet",
    GoalFate.RUNNING: "the server has not said that it ended",
    GoalFate.LOST: "the server is gone, or silent",
    GoalFate.LEFT: "nobody looks after it any more",
}
GONE = "its server is gone, or silent"
ELSEWHERE = "one server has stopped it, and another on the same name has not confirmed that it has"


def name_others_left(text: str, ending: Ending, call: ErrorContext) -> str:
    """Name the goals of the call that may run and that a text does not mention (C2.8)."""
    told = " STILL " in text and call.goal_id  # the text says that about its own goal
    return name_those_left(goal for goal in ending.goals if goal.goal_id != told)


def name_those_left(goals: Iterable[GoalReport]) -> str:
    """Name the goals of a call that may run, and say why they may; empty if there are none."""
    left: dict[str, list[str]] = {}
    for goal in goals:
        if goal.fate.may_run:
            left.setdefault(why_it_may_run(goal), []).append(f"goal {goal.goal_id}")
    return "".join(_may_still_run(named, why) for why, named in left.items())


def why_it_may_run(goal: GoalReport) -> str:
    """Say why a goal may run, as a part of a sentence."""
    refused = goal.fate is GoalFate.RUNNING and goal.cancel_refused
    return (
        "the server refused to cancel it" if refused else _WHY_IT_MAY_RUN.get(goal.fate, ELSEWHERE)
    )


def _may_still_run(goals: list[str], why: str) -> str:
    more = f" and {len(goals) - _NAMED} more" if len(goals) > _NAMED else ""
    which = f"{' and '.join(goals[:_NAMED])}{more} of this call"
    return f" {which[0].upper()}{which[1:]} MAY STILL BE RUNNING: {why}."


def cancel_sentence(ending: Ending, call: ErrorContext) -> str:
    """Say what happened to a goal that was given up on.

    If it may run, the text has the word STILL: `name_others_left` looks for it.
    """
    if ending.abandoned:
        return " It was left to run on the server."
    if ending.ended_first and ending.result is None:
        return f" It had ended as {ending.ended_as}, and only its result is missing."
    if ending.own_cancel is CancelReport.CONFIRMED:
        if ending.status is GoalState.SUCCEEDED:
            when = "before that" if ending.ended_first else "while it was being cancelled"
            return f" It succeeded {when}: its result came late, and is in `late_result`."
        if ending.ended_as is not GoalState.CANCELED:
            return f" It ended as {ending.ended_as} all the same, and runs no more."
        return " It was cancelled on the server, which confirmed that it runs no more."
    if ending.own_cancel is CancelReport.REFUSED:
        return " The server refused to cancel it: IT IS STILL RUNNING."
    if ending.own_cancel is CancelReport.UNKNOWN:
        why = unconfirmed(ending, call)
        return f" {why[0].upper()}{why[1:]}: IT MAY STILL BE RUNNING."
    return ""


def unconfirmed(ending: Ending, call: ErrorContext) -> str:
    """Say why it is not known that a cancelled goal has stopped, as a part of a sentence."""
    if ending.elsewhere:
        return ELSEWHERE
    if is_lost(ending, call):
        return GONE
    if ending.news is LastNews.UNKNOWN_TO_SERVER:  # then nobody has waited any longer
        return "its server does not know it yet, and may still accept it"
    within = f"within {call.timeouts.cancel:g} s"
    if is_being_cancelled(call):
        limit = "the time of Timeouts(cancel=...)"
        return f"the server is cancelling it, and did not end it {within}, {limit}"
    return f"the server did not confirm its cancellation {within}"


def is_being_cancelled(call: ErrorContext) -> bool:
    """Whether the server was seen to cancel this goal."""
    return (call.goal_id, GoalState.CANCELING) in [(e.goal_id, e.state) for e in call.timeline]


def is_lost(ending: Ending, call: ErrorContext) -> bool:
    """Whether the server of this goal is out of sight: then nobody has waited for it."""
    return GoalFate.LOST in _fates(ending, call)


def is_left(ending: Ending, call: ErrorContext) -> bool:
    """Whether nobody looks after this goal: it was to be attached to, and was never followed."""
    return GoalFate.LEFT in _fates(ending, call)


def _fates(ending: Ending, call: ErrorContext) -> list[GoalFate]:
    return [goal.fate for goal in ending.goals if goal.goal_id == call.goal_id]

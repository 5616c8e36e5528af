"""Reads and checks scripts and their steps. No rclpy here."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

_INT32 = 2**31
"""This number and larger ones do not fit into the int32 fields of Fibonacci."""
_MOST_SECONDS = 1e9
"""Thirty years: for ever in a test, and no clock overflows."""


@dataclass(frozen=True)
class Step:
    """One step: its word and its values."""

    word: str
    value: Any = None
    period: float = 0.0


@dataclass(frozen=True)
class Script:
    """What happens to one goal."""

    before: tuple[Step, ...]  # the steps before the answer to the request
    decision: Step  # "accept", "accept_after", "reject" or "no_answer"
    explicit: bool  # whether the answer is written in the script
    after: tuple[Step, ...]  # the steps after the acceptance


def _seconds(value: Any) -> bool:
    return type(value) in (int, float) and 0 <= value < _MOST_SECONDS


def _numbers(value: object) -> bool:
    return isinstance(value, list) and all(type(n) is int and -_INT32 <= n < _INT32 for n in value)


def _feedback(value: object) -> bool:
    return _numbers(value) or (type(value) is int and value > 0)


def _end(value: object) -> bool:
    return value is None or _numbers(value)


def _how(value: object) -> bool:
    return value in ("kill", "clean")


def _alone(value: object) -> bool:
    return value is None


@dataclass(frozen=True)
class _Word:
    """How to write a step, and where it may be."""

    example: str  # how to write it
    right: Callable[[object], bool] = _alone  # whether a value fits
    decides: bool = False  # it answers the request: only once, and before all steps that execute
    early: bool = False  # it may come before the answer
    ends: bool = False  # nothing may follow


_WORDS = {
    "accept": _Word('"accept"', decides=True),
    "accept_after": _Word('{"accept_after": 0.5}', _seconds, decides=True),
    "reject": _Word('"reject"', decides=True, ends=True),
    "no_answer": _Word('"no_answer"', decides=True, ends=True),
    "wait": _Word('{"wait": 0.2}', _seconds, early=True),
    "gate": _Word('"gate"', early=True),
    "feedback": _Word(
        '{"feedback": [1, 2, 3]} or {"feedback": 5} or {"feedback": 5, "period": 0.05}', _feedback
    ),
    "refuse_cancel": _Word('"refuse_cancel"', early=True),
    "ignore_cancel": _Word('"ignore_cancel"', early=True),
    "heed_cancel": _Word('"heed_cancel"', early=True),
    "cancel_after": _Word('{"cancel_after": 0.3}', _seconds, early=True),
    "cancel_itself": _Word('"cancel_itself"'),
    "succeed": _Word('"succeed" or {"succeed": [0, 1]}', _end, ends=True),
    "abort": _Word('"abort" or {"abort": [102]}', _end, ends=True),
    "raise": _Word('"raise"', ends=True),
    "no_result": _Word('"no_result"', ends=True),
    "never": _Word('"never"', ends=True),
    "crash": _Word('{"crash": "kill"} or {"crash": "clean"}', _how, early=True, ends=True),
    "restart": _Word('{"restart": "kill"} or {"restart": "clean"}', _how, early=True, ends=True),
}

MODES = ("refuse_cancel", "ignore_cancel", "heed_cancel", "cancel_after")
"""The steps that say how to react to a cancel."""


def parse_scripts(text: str) -> list[Script]:
    """Return the scripts, one or more, in a text of JSON.

    Raises:
        ValueError: It is not JSON, or a step is wrong; the text says which one, and why.
    """
    try:
        raw = json.loads(text)
    except ValueError as error:
        raise ValueError(f"the script is not JSON: {error}; it is {text!r}") from None
    if not isinstance(raw, list):
        raise ValueError(f"the script is not a list of steps, but {text}")
    return read_scripts(raw)


def read_scripts(raw: list[Any]) -> list[Script]:
    """Return the scripts in data from JSON.

    Raises:
        ValueError: A step is wrong; the text says which one, and why.
    """
    if not any(isinstance(step, list) for step in raw):
        return [_script(raw, "script")]
    for index, script in enumerate(raw):
        if not isinstance(script, list):
            raise ValueError(
                f"script[{index}] is {json.dumps(script)} beside lists: either all are steps, for"
                " every goal, or all are lists of steps, one for each goal in turn"
            )
    return [_script(script, f"script[{index}]") for index, script in enumerate(raw)]


def _script(raw: list[Any], where: str) -> Script:
    steps = [_step(step, f"{where}[{index}]") for index, step in enumerate(raw)]
    words = [_WORDS[step.word] for step in steps]
    decisions = [index for index, word in enumerate(words) if word.decides]
    if decisions:
        at = decisions[0]
        rest = steps[at + 1 :]
        decision = steps[at]
    else:
        # Steps about cancels are valid from the acceptance on.
        at = next((i for i, step in enumerate(steps) if step.word not in MODES), len(steps))
        rest = steps[at:]
        decision = Step("accept")
    for index, word in enumerate(words):
        problem = None
        if index in decisions[1:]:
            problem = f"the goal was decided about by {where}[{at}]"
        elif index < at and not word.early:
            problem = f"the goal is not accepted before {where}[{at}]"
        elif index > at and words[index - 1].ends:
            problem = f"{where}[{index - 1}] is the end"
        if problem:
            raise ValueError(f"{where}[{index}] is {json.dumps(raw[index])}, but {problem}")
    return Script(tuple(steps[:at]), decision, bool(decisions), tuple(rest))


def _step(raw: object, where: str) -> Step:
    word, value, period, extra = raw, None, None, []
    if isinstance(raw, dict):
        rest = dict(raw)
        period = rest.pop("period", None)
        word, value = next(iter(rest.items()), (None, None))
        extra = list(rest)[1:]
    known = _WORDS.get(word) if isinstance(word, str) else None
    if known is None or extra:
        problem = "has more than one word" if known else "is no step"
        words = "\n  ".join(entry.example for entry in _WORDS.values())
        raise ValueError(
            f"{where} is {json.dumps(raw)}, which {problem}; the steps are:\n  {words}"
        )
    fits = known.right(value) and (isinstance(raw, str) or value is not None)
    if not fits or (period is not None and not (word == "feedback" and _seconds(period))):
        raise ValueError(f"{where} is {json.dumps(raw)}; it is written {known.example}")
    return Step(str(word), value, period or 0.0)

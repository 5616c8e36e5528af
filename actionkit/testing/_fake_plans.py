"""Says what a fake server does with its goals: checked settings, or functions for them."""

from __future__ import annotations

import inspect
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from actionkit._messages.convert import from_plain
from actionkit._messages.paths import is_message_class
from actionkit._model.arguments import check_function
from actionkit._model.field_errors import FieldProblem, shown
from actionkit._model.settings import check_seconds
from actionkit._model.similar_names import similar_names

ENDS = ("succeeded", "aborted", "canceled", "never")
CANCELS = ("accept", "refuse", "ignore")
EARLY = ("accept", "period", "end", "preempts")
"""Settings that must be known before a goal is accepted."""


@dataclass(frozen=True)
class Plan:
    """What happens to a goal: each setting is a checked value, or a function of the goal."""

    action: Any  # the action's class
    settings: Mapping[str, Any]  # all of them, by name
    where: str = ""  # the place of the settings, for errors: `""` or `"script[2]."`

    @classmethod
    def checked(cls, action: Any, settings: Mapping[str, Any]) -> Plan:
        """Return the plan for a complete set of settings.

        Raises:
            TypeError, ValueError: A setting is wrong.
        """
        return cls(
            action, {name: checked(action, name, value, name) for name, value in settings.items()}
        )

    def changed(self, settings: object, where: str) -> Plan:
        """Return a plan with some settings replaced.

        Raises:
            TypeError, ValueError: A setting is wrong, or does not exist.
        """
        if not isinstance(settings, Mapping):
            raise TypeError(
                f"{where}={shown(settings)} must be a mapping of settings, such as"
                ' {"end": "aborted"}, or a function of the goal that returns one'
            )
        merged = dict(self.settings)
        for name, value in settings.items():
            if name not in merged:
                near = similar_names(str(name), list(merged))
                hint = f"; did you mean {near[0]!r}?" if near else "."
                raise ValueError(
                    f"{where}: there is no setting {name!r}{hint} There are: {', '.join(merged)}"
                )
            merged[name] = checked(self.action, name, value, f"{where}.{name}")
        return Plan(self.action, merged, f"{where}.")

    @property
    def asks_early(self) -> bool:
        """Return whether a user's function is called before the goal is accepted."""
        return any(callable(self.settings[name]) for name in EARLY)

    def settled(self, goal: Any) -> Plan:
        """Return the plan with values for the settings that are needed before the acceptance."""
        known = {name: self.value(name, goal) for name in EARLY}
        return Plan(self.action, {**self.settings, **known}, self.where)

    def value(self, name: str, goal: Any) -> Any:
        """Return a setting for a goal. A function's answer is checked, its errors go on."""
        setting = self.settings[name]
        if not callable(setting):
            return setting
        return checked_value(self.action, name, setting(goal), self.where + name)

    def feedback(self, goal: Any) -> Iterator[Any]:
        """Yield the feedback messages for a goal; from a generator, each when it comes."""
        setting = self.settings["feedback"]
        if not callable(setting):
            return iter(setting)
        return feedback_of(self.action, setting(goal), self.where + "feedback")


class Script:
    """Gives each goal its plan: from the script in turn, then the server's own settings.

    Safe to use from any thread.
    """

    def __init__(self, defaults: Plan) -> None:
        self._defaults = defaults
        self._lock = threading.Lock()
        self._next: deque[Plan | Callable[[Any], Any]] = deque()
        self._all: Callable[[Any], Any] | None = None

    def replace(self, script: object) -> None:
        """Drop the rest of the old script, and use this one from the next goal on.

        Raises:
            TypeError, ValueError: It is wrong; the text says where, and why.
        """
        wanted = "a function (goal) -> mapping of settings"
        if callable(script):
            check_function("script", script, wanted)
            plans: list[Any] = []
            every: Any = script
        else:
            if not isinstance(script, Iterable) or isinstance(script, (str, bytes, Mapping)):
                raise TypeError(
                    f"script={shown(script)} must be a list with an entry for each goal in turn,"
                    ' such as [{"accept": False}, {"end": "aborted"}], or a function of the goal'
                )
            plans, every = [], None
            for index, entry in enumerate(script):
                where = f"script[{index}]"
                if callable(entry):
                    check_function(where, entry, wanted)
                    plans.append(lambda goal, entry=entry, where=where: (entry(goal), where))
                else:
                    plans.append(self._defaults.changed(entry, where))
        with self._lock:
            self._next = deque(plans)
            self._all = every and (lambda goal: (every(goal), "script"))

    def take(self) -> Plan | Callable[[Any], Any]:
        """Return the plan of the next goal, or a function for it."""
        with self._lock:
            return self._next.popleft() if self._next else self._all or self._defaults

    def asked(self, function: Callable[[Any], Any], goal: Any) -> Plan:
        """Return a function's plan for a goal; its errors are not caught."""
        settings, where = function(goal)
        return self._defaults if settings is None else self._defaults.changed(settings, where)


def checked(action: Any, name: str, value: object, path: str) -> Any:
    """Return a checked setting: a function unchanged, or a value as messages or plain values.

    Raises:
        TypeError, ValueError: It is wrong; the text begins with the path.
    """
    if callable(value) and not (name in ("feedback", "result") and is_message_class(value)):
        check_function(path, value, "a value, or a function of the goal that returns it")
        if inspect.isasyncgenfunction(value):
            raise TypeError(f"{path}={value!r} must be a plain function, not an async generator")
        return value
    if name == "feedback":
        return tuple(feedback_of(action, value, path))
    return checked_value(action, name, value, path)


def checked_value(action: Any, name: str, value: Any, path: str) -> Any:
    """Return a checked value of a setting that is not the feedback.

    Raises:
        TypeError, ValueError: It is wrong; the text begins with the path.
    """
    if name == "result":
        return action.Result() if value is None else _message(action.Result, value, path)
    if name in ("accept", "preempts"):
        if not isinstance(value, bool):
            raise TypeError(f"{path}={shown(value)} must be True or False")
        return value
    if name == "period":
        return check_seconds(path, value, optional=False)
    choices = ENDS if name == "end" else CANCELS
    if value not in choices:
        words = ", ".join(map(repr, choices[:-1]))
        raise ValueError(f"{path}={shown(value)} must be {words} or {choices[-1]!r}")
    return value


def feedback_of(action: Any, value: Any, path: str) -> Iterator[Any]:
    """Yield feedback messages; each is checked when its turn comes.

    Raises:
        TypeError, ValueError: It is not a list of feedback, or a message is wrong.
    """
    single = isinstance(value, (str, bytes, Mapping)) or is_message_class(type(value))
    if single or not isinstance(value, Iterable):
        hint = f"; for one write [{shown(value)}]" if single else ", such as ()"
        raise TypeError(
            f"{path}={shown(value)} must be a list of feedback, messages or mappings{hint}"
        )
    return (_message(action.Feedback, one, f"{path}[{n}]") for n, one in enumerate(value))


def _message(cls: Any, value: Any, path: str) -> Any:
    try:
        return from_plain(cls, value)
    except FieldProblem as problem:
        problem.add_parent(path)
        raise

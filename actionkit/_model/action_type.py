"""What an action type is to the type checkers, so that one argument types a whole client.

ROS generates `Fibonacci` as a class that is never instantiated and holds its three message
classes. A checker matches that class object against `ActionType` and takes the messages from it:
`Client(Fibonacci, "fibonacci")` is a
`Client[Fibonacci.Goal, Fibonacci.Result, Fibonacci.Feedback]`.

Where there are no type stubs for an interface package, its actions are `Any` to a checker, and so
are their messages.
"""

from __future__ import annotations

from typing import Any, Protocol

from typing_extensions import TypeVar

GoalT = TypeVar("GoalT", default=Any)
ResultT = TypeVar("ResultT", default=Any)
FeedbackT = TypeVar("FeedbackT", default=Any)

_GoalT_co = TypeVar("_GoalT_co", covariant=True)
_ResultT_co = TypeVar("_ResultT_co", covariant=True)
_FeedbackT_co = TypeVar("_FeedbackT_co", covariant=True)


class ActionType(Protocol[_GoalT_co, _ResultT_co, _FeedbackT_co]):
    """What an action type holds. Take one as `type[ActionType[GoalT, ResultT, FeedbackT]]`.

    As `type[…]` of it and with properties, because this is the form in which both mypy and
    pyright accept nested classes (our stubs), classes imported into a class body (what ROS
    generates, which pyright reads where there are no stubs) and assigned ones. Against a plain
    `ActionType` mypy refuses the first two and pyright the last.
    """

    @property
    def Goal(self) -> type[_GoalT_co]:
        """The class of goals."""
        ...

    @property
    def Result(self) -> type[_ResultT_co]:
        """The class of results."""
        ...

    @property
    def Feedback(self) -> type[_FeedbackT_co]:
        """The class of feedback, as the user gets it, without its goal id."""
        ...

"""What an action type is to the type checkers, so that one argument types a whole client.

ROS generates `Fibonacci` as a class that is never instantiated and holds its three message
classes. `Client(Fibonacci, "fibonacci")` is a `Client[Fibonacci]`. Where a method takes or returns
messages, its `self` is a `Client[ActionType[GoalT, ResultT, FeedbackT]]`: a checker matches
`Fibonacci` against `ActionType`, and takes the messages from it.

Where there are no type stubs for an interface package, its actions are `Any` to a checker, and so
are their messages.
"""

from __future__ import annotations

from typing import Any, Protocol, TypeVar

# None of these has a default: `GoalFuture[Fibonacci]` lacks something, and so does a mere `Client`
# to strict checkers. With one they would be `Any` in silence.
GoalT = TypeVar("GoalT")
ResultT = TypeVar("ResultT")
FeedbackT = TypeVar("FeedbackT")


class ActionType(Protocol[GoalT, ResultT, FeedbackT]):  # type: ignore[misc]
    """What an action type holds. Take one as `type[ActionType[GoalT, ResultT, FeedbackT]]`.

    As `type[…]` of it and with properties, because this is the form in which both mypy and
    pyright accept nested classes (our stubs), classes imported into a class body (what ROS
    generates, which pyright reads where there are no stubs) and assigned ones. Against a plain
    `ActionType` mypy refuses the first two and pyright the last.

    Its type variables could be covariant, as checkers remark. But then pyright takes `GoalT` of
    `ActionBehaviour(name, client, goal)` for the union of the client's goal and the type of
    `goal`, and refuses nothing.
    """

    @property
    def Goal(self) -> type[GoalT]:
        """The class of goals."""
        ...

    @property
    def Result(self) -> type[ResultT]:
        """The class of results."""
        ...

    @property
    def Feedback(self) -> type[FeedbackT]:
        """The class of feedback, as the user gets it, without its goal id."""
        ...


ActionT_co = TypeVar("ActionT_co", bound=ActionType[Any, Any, Any], covariant=True)

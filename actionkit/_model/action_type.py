"""Describes an action type to type checkers, so that one argument gives a client all its types.

ROS generates `Fibonacci` as a class that has three message classes and is never instantiated.
`Client(Fibonacci, "fibonacci")` is a `Client[Fibonacci]`. In a method that takes or returns
messages, `self` is a `Client[ActionType[GoalT, ResultT, FeedbackT]]`: a checker matches `Fibonacci`
with `ActionType`, and so finds the messages.

If an interface package has no type stubs, its actions and their messages are `Any` to a checker.
"""

from __future__ import annotations

from typing import Any, Protocol, TypeVar

# These have no defaults, so that checkers report `GoalFuture[Fibonacci]` and (strict ones) a bare
# `Client`. With defaults, the missing types would silently be `Any`.
GoalT = TypeVar("GoalT")
ResultT = TypeVar("ResultT")
FeedbackT = TypeVar("FeedbackT")


class ActionType(Protocol[GoalT, ResultT, FeedbackT]):  # type: ignore[misc]
    """An action type. Annotate one as `type[ActionType[GoalT, ResultT, FeedbackT]]`.

    The form `type[…]` and the properties are needed: only so do both mypy and pyright accept nested
    classes (our stubs), classes imported into a class body (ROS's code, which pyright reads if
    there are no stubs) and assigned classes. With a plain `ActionType`, mypy refuses the first two
    and pyright the last.

    Checkers remark that the type variables could be covariant. But then, for `GoalT` of
    `ActionBehaviour(name, client, goal)`, pyright takes the union of the client's goal and the type
    of `goal`, and refuses nothing.
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
        """The class of feedback as users get it, without the goal id."""
        ...


ActionT_co = TypeVar("ActionT_co", bound=ActionType[Any, Any, Any], covariant=True)


def type_name_of(action_type: Any) -> str:
    """Return the ROS name of an action class.

    Raises:
        TypeError: It is not an action class.
    """
    wanted = ("Goal", "Result", "Feedback", "Impl")
    if not isinstance(action_type, type) or not all(hasattr(action_type, n) for n in wanted):
        raise TypeError(
            f"action_type={action_type!r} must be an action class, such as"
            " test_msgs.action.Fibonacci; not a message, a service, or its Goal"
        )
    package = action_type.__module__.split(".", 1)[0]
    return f"{package}/action/{action_type.__name__}"

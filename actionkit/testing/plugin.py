"""The pytest plugin. pytest loads it if ActionKit is installed.

So nothing heavy is imported here: people also run pytest for other things, and may have no rclpy.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any, Literal, Protocol

import pytest

if TYPE_CHECKING:
    from actionkit._model.action_type import ActionType, FeedbackT, GoalT, ResultT
    from actionkit.servers import Server
    from actionkit.servers._behaviours.behaviour import Option
    from actionkit.testing import FakeServer


class ActionServerFactory(Protocol):
    """The type of the `action_server` fixture."""

    def __call__(
        self,
        name: str,
        *,
        action_name: str = "fibonacci",
        action_type: type | str | None = None,
        **options: Option,
    ) -> Server: ...


class FakeServerFactory(Protocol):
    """The type of the `fake_server` fixture, with the arguments of `FakeServer`."""

    def __call__(
        self,
        action_type: type[ActionType[GoalT, ResultT, FeedbackT]],
        name: str,
        *,
        accept: bool | Callable[[GoalT], bool] = ...,
        feedback: Iterable[FeedbackT | Mapping[str, Any]]
        | Callable[[GoalT], Iterable[FeedbackT | Mapping[str, Any]]] = ...,
        period: float | Callable[[GoalT], float] = ...,
        result: ResultT
        | Mapping[str, Any]
        | Callable[[GoalT], ResultT | Mapping[str, Any] | None]
        | None = ...,
        end: Literal["succeeded", "aborted", "canceled", "never"] | Callable[[GoalT], str] = ...,
        cancel: Literal["accept", "refuse", "ignore"] | Callable[[GoalT], str] = ...,
        preempts: bool | Callable[[GoalT], bool] = ...,
    ) -> FakeServer[GoalT, ResultT, FeedbackT]: ...


@pytest.fixture
def ros_domain(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """Return the id of a ROS domain that only this test uses, on this machine only.

    It is set in the environment, so everything that the test starts uses that domain. A context
    that was initialised before does not. So the test fails at once if there is one. ActionKit also
    refuses to use any other domain; see `isolated_domain`. There is one exception: if
    `rclpy.init()` was called in a domain that `isolated_domain` has reserved, for example for a
    whole session, the test uses that domain.
    """
    from actionkit.testing._domains import domain_of_default_context, isolated_domain

    with ExitStack() as stack:
        domain, problem = None, ""
        try:
            domain = domain_of_default_context()
            if domain is None:
                domain = stack.enter_context(isolated_domain())
        except RuntimeError as error:
            problem = str(error)
        if domain is None:  # not while the error is handled: pytest would show both
            pytest.fail(problem, pytrace=False)
        monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
        monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        # The older variable overrides the range, and peers are searched for beyond the range.
        monkeypatch.delenv("ROS_LOCALHOST_ONLY", raising=False)
        monkeypatch.delenv("ROS_STATIC_PEERS", raising=False)
        yield domain


@pytest.fixture
def action_server(ros_domain: int) -> Iterator[ActionServerFactory]:
    """Return a function that starts reference servers in the test's own ROS domain.

        def test_it(action_server):
            server = action_server("countdown", action_name="count", period=0.01)

    They are stopped at the end of the test.
    """
    from actionkit import servers

    with ExitStack() as running:

        def start(
            name: str,
            *,
            action_name: str = "fibonacci",
            action_type: type | str | None = None,
            **options: Option,
        ) -> Server:
            return running.enter_context(
                servers.start(
                    name,
                    action_name=action_name,
                    action_type=action_type,
                    domain_id=ros_domain,
                    **options,
                )
            )

        yield start


@pytest.fixture
def fake_server(ros_domain: int) -> Iterator[FakeServerFactory]:
    """Return a function that makes and starts `FakeServer`s in the test's own ROS domain.

        def test_it(fake_server):
            server = fake_server(Pick, "pick", result={"ok": True})

    They are stopped at the end of the test. If one of your functions raised an error that the test
    did not get, it is raised then.
    """
    from actionkit.testing import FakeServer

    with ExitStack() as running:

        def start(action_type: Any, name: str, **settings: Any) -> Any:
            server = FakeServer(action_type, name, domain_id=ros_domain, **settings)
            return running.enter_context(server)

        yield start

"""What ActionKit's own packages use of the client beyond its public names.

`trees`, `agents` and `cli` use nothing else of it, so that the client can change inside. It is not
for users, and may change in any release. Besides what is below, it has:

- `Classify`, `check_classify`: the type of `classify=`, and its check.
- `blocks_another`: whether no other goal may be sent beside those of a call.
- `in_thread`: await a function that blocks. `unless_by_anyio`: wait in a cancelled task.
- `log_later`, `log_own_error`: log without blocking.
- `name_those_left`: name the goals of a call that may run.
- `mute`: do not report goals at exit, because the program has done that.
- `unfinished_goals`: whether a ledger has goals of dead processes that nobody follows.
- `usual_ledger`: the path of the ledger of programs that are guarded.
- `watch_over`: start a process that cancels what this one leaves running.
- `writers`: the living processes that write in a ledger.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import ExitStack
from functools import partial
from typing import Any

from actionkit._calls.awaiting.drivers import in_thread, unless_by_anyio
from actionkit._calls.ending.closing import end_calls
from actionkit._calls.errors.still_running import name_those_left
from actionkit._calls.futures.future import GoalFuture
from actionkit._calls.futures.goals_left import mute
from actionkit._calls.ledger.chosen import usual_path as usual_ledger
from actionkit._calls.retries.classify import Classify, check_classify
from actionkit._calls.sending.replacing import blocks_another
from actionkit._client import Client
from actionkit._leftovers.ledger import unfinished as unfinished_goals
from actionkit._leftovers.ledger import writers
from actionkit._leftovers.watcher import watch_over
from actionkit._model.environment.domain import Domain
from actionkit._model.settings import RetryPolicy
from actionkit._threads.diagnostics import log_later, log_own_error

__all__ = [
    "Classify",
    "blocks_another",
    "check_classify",
    "client_in_domain",
    "close_together",
    "end_at_exit",
    "in_thread",
    "log_later",
    "log_own_error",
    "mute",
    "name_those_left",
    "prepare_call",
    "status_topic",
    "type_of",
    "unfinished_goals",
    "unless_by_anyio",
    "usual_ledger",
    "watch_over",
    "writers",
]


def client_in_domain(
    domain_id: int | None, action_type: Any, action_name: str, **settings: Any
) -> Client[Any]:
    """Return a client in a ROS domain, apart from the context of `rclpy.init()`.

    `None` means the domain of the environment. The settings are those of `Client`.
    """
    return Client(action_type, action_name, node=Domain(domain_id), **settings)


def end_at_exit() -> None:
    """Shut down in order at the interpreter's exit, also without a client. Imports rclpy."""
    from actionkit._calls.ending.exit import arm

    arm()


def type_of(client: Client[Any]) -> Any:
    """Return the action type of a client."""
    return client._action_type


def status_topic(client: Client[Any]) -> str:
    """Return the full name of the status topic of a client's action."""
    return client._session.connection.names.status


def prepare_call(
    client: Client[Any],
    goal: object,
    timeout: Any,
    retry: RetryPolicy | None = None,
    classify: Classify | None = None,
    on_feedback: Callable[[Any], object] | None = None,
    before_resend: Callable[[], object] | None = None,
    preempts: GoalFuture[Any, Any] | None = None,
    key: str | None = None,
) -> tuple[GoalFuture[Any, Any], Callable[[], None]]:
    """Return the future of a call that has not begun, and the function that begins it.

    So the future can be kept before there is a goal, and no interruption loses it. The arguments
    and errors are those of `Client.call_async`; `before_resend` is that of `Request`. `preempts` is
    `replaces=` with `preempt=True`.
    """
    arguments = goal, on_feedback, timeout, retry, classify, before_resend
    call = client._prepare(*arguments, replaces=preempts, preempt=preempts is not None, key=key)
    return call.future, partial(client._session.begin, call)


def close_together(
    clients: Iterable[Client[Any]], others: Iterable[GoalFuture[Any, Any]] = ()
) -> None:
    """Close clients, so that none waits for the end of another one's goals.

    It also waits for the futures of `others`, which were cancelled. The wait ends when no goal has
    ended for `timeouts.cancel` seconds (the longest of all) and half a second.
    """
    closing = list(clients)
    with ExitStack() as stack:  # after Ctrl-C they are closed, too, and wait for nothing
        for client in closing:
            stack.callback(client.close)
        sessions = [client._session for client in closing if not client._session.inherited]
        end_calls(sessions, list(others))

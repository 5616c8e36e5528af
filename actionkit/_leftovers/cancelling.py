"""Cancels the goals that processes have left running."""

from __future__ import annotations

import threading
import time
import uuid
from collections import defaultdict
from collections.abc import Callable, Iterable
from functools import partial
from typing import Any

from actionkit._calls.future import GoalFuture
from actionkit._calls.ledger.store import Leftover
from actionkit._client import Client
from actionkit._leftovers.finding import asked, find, in_sight
from actionkit._messages.by_name import interface_class
from actionkit._model.domain import Domain
from actionkit._model.errors import ClientClosedError
from actionkit._model.settings import Timeouts
from actionkit._model.values import CancelReport, GoalState
from actionkit._threads.diagnostics import log_own_error
from actionkit._threads.waiting import Flag

_LAST = 3.0
"""Seconds at the end for servers to answer about goals that nobody has seen; a third at most."""
_PER_SECOND = 1000
"""Goals that servers are asked about in a second, roughly: many get more time for that."""
_END = 0.5
"""Seconds for a goal's result to come after its end was seen in the status."""
_TICK = 0.05
"""Seconds between two looks whether goals have ended."""
_LATE = 60.0
"""Seconds in which a server that needs long may still accept a goal, from when it was written down.
It may have been sent later, after a wait for the server. So this counts only where there are many.
"""
_MANY = 50
"""So many goals that no server knows yet cannot all be asked for until the end."""
_WORST = (
    CancelReport.REFUSED,
    CancelReport.UNKNOWN,
    CancelReport.CONFIRMED,
    CancelReport.NOT_NEEDED,
)
_Told = dict[Leftover, CancelReport]


def cancel_all(
    calls: Iterable[Leftover], seconds: float, server: float, unseen: set[Leftover]
) -> _Told:
    """Cancel the goals of calls; return what happened to each call.

    This takes so many `seconds` at most; a server is looked for `server` seconds at most. Calls
    are added to `unseen` if no server of their action is in sight after that.
    """
    by_action: dict[tuple[int, str, str], list[Leftover]] = defaultdict(list)
    for call in calls:
        by_action[call.domain_id, call.action_name, call.type_name].append(call)
    told = {call: CancelReport.UNKNOWN for each in by_action.values() for call in each}
    # One beside the other: an action without a server must not delay the others.
    done = {action: Flag() for action in by_action}
    for action, left in by_action.items():
        flag = done[action]
        cancel = partial(_cancel, *action, left, seconds, server, told, unseen, flag)
        run = partial(_in_thread, cancel, flag)
        threading.Thread(target=run, name="actionkit-leftovers", daemon=True).start()
    until = time.monotonic() + seconds
    for flag in done.values():
        flag.wait(max(0.0, until + _TICK - time.monotonic()))
    return dict(told)


def _in_thread(cancel: Callable[[], None], done: Flag) -> None:
    try:
        cancel()
    except (ImportError, ValueError):
        pass  # the action's package is not installed here
    except ClientClosedError:
        pass  # the program ends
    except Exception:  # noqa: BLE001  the goals of other actions count, too
        log_own_error()
    finally:
        done.set()


def _cancel(
    domain: int,
    name: str,
    kind: str,
    calls: list[Leftover],
    seconds: float,
    server: float,
    told: _Told,
    unseen: set[Leftover],
    done: Flag,
) -> None:
    """Cancel the goals of one action."""
    until = time.monotonic() + seconds
    limits = Timeouts(server=min(server, seconds))
    action_type: Any = interface_class(kind, "action")
    with Client(action_type, name, node=Domain(domain), timeouts=limits) as client:
        if not client.wait_for_server(max(0.0, min(server, until - _TICK - time.monotonic()))):
            if seconds >= server and not in_sight(client):
                unseen.update(calls)
            return
        futures: dict[Leftover, list[GoalFuture[Any, Any]]] = defaultdict(list)
        not_found: dict[uuid.UUID, Leftover] = {}

        def stop(call: Leftover, goal_id: uuid.UUID) -> None:
            future = client.attach(goal_id, on_give_up="cancel")
            future.cancel()
            futures[call].append(future)

        last = min(_LAST, seconds / 3) + min(len(calls) / _PER_SECOND, seconds / 3)
        for call, goal_id in find(client, calls, until - last):
            if goal_id is None:
                not_found[call.goal_id] = call
            else:
                stop(call, goal_id)
        few = len(not_found) < _MANY

        def may_come(goal_id: uuid.UUID) -> bool:
            return few or time.time() - not_found[goal_id].sent < _LATE

        newest_first = reversed(not_found)
        for goal_id, is_known in asked(client, newest_first, until - 2 * _TICK, may_come):
            if is_known:
                stop(not_found[goal_id], goal_id)
            else:
                told[not_found[goal_id]] = CancelReport.NOT_NEEDED
        every = [future for each in futures.values() for future in each]
        while any(future.known_to_run is not False for future in every):
            if time.monotonic() >= until:
                break
            Flag().wait(_TICK)
        for future in every:
            if future.known_to_run is False:  # its end, which says how, may come a moment later
                future._wait_until_over(min(_END, until - time.monotonic()))
        told.update(
            (call, min(map(_report, each), key=_WORST.index)) for call, each in futures.items()
        )
        done.set()  # closing may take longer
    for future in every:
        future.outcome(0)  # or the log would say that nobody has asked


def _report(future: GoalFuture[Any, Any]) -> CancelReport:
    """Return what happened to the goal of a future."""
    if future.known_to_run is False:
        canceled = any(event.state is GoalState.CANCELED for event in future.timeline)
        return CancelReport.CONFIRMED if canceled else CancelReport.NOT_NEEDED
    refused = any(goal.cancel_refused for goal in future._call.goals.reports)
    return CancelReport.REFUSED if refused else CancelReport.UNKNOWN

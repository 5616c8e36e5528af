"""The calls and attempts that one port carries, until none is left and the port can be freed.

Everything happens on the communication thread, except the constructor, `begin` and `running`.
"""

from __future__ import annotations

import logging
import time
import uuid
from collections.abc import Callable
from functools import partial
from typing import Any

from actionkit._calls.attempt import Attempt
from actionkit._calls.call import Call
from actionkit._calls.explain import CLIENT_CLOSED
from actionkit._calls.graph_snapshot import GraphSnapshot
from actionkit._calls.signals import is_ending
from actionkit._goal.facts import GoalFacts
from actionkit._goal.stages import Stage
from actionkit._model.settings import Timeouts
from actionkit._ros.port import Port
from actionkit._threads.clock import TimerHandle
from actionkit._threads.diagnostics import log_later
from actionkit._threads.waiting import Flag

LINGER = 30.0
"""Seconds that a closed client goes on watching for the late acceptance of a goal (C2.4). A server
that is busy in a callback answers only after that, and few callbacks take longer."""
_NODE_CHECK = 1.0
"""Seconds between looks whether the user's node was destroyed, while calls are in flight. Nothing
tells of that, and nothing polls more often (C7.4)."""
_CTRL_C_HEARD = 0.6
"""Seconds in which a blocking call hears Ctrl-C (see `_threads.waiting`). It cancels its goal, also
where the client abandons the others."""
_MOST = 4096
"""Goals that may run, from which on the oldest that was lost with its server is forgotten."""
_DIED = "the communication thread of ActionKit died"


class PortCarrier:
    """The calls and attempts in flight over one port."""

    def __init__(self, port: Port, on_freed: Callable[[], None], *, abandon: bool = False) -> None:
        """Take over a port.

        Args:
            port: The port.
            on_freed: Called when it is freed.
            abandon: Whether closing leaves goals to run.
        """
        self.port = port
        self._abandon = abandon
        self.action_name = port.identity.action_name
        self.type_name = port.identity.type_name
        self.calls: set[Call] = set()
        self.released = Flag()
        """Set when `release` has run, and has freed the port if nothing was in flight."""
        self._on_freed = on_freed
        self._attempts: dict[Attempt, None] = {}
        """Those with a goal that may run, oldest first."""
        self._releasing = False
        self._linger_timer: TimerHandle | None = None
        self._node_timer: TimerHandle | None = None
        self._closing = False
        self.ended_because = ""
        """Why calls end though their client was not closed."""
        self.decode_feedback = port.decode_feedback
        self.call_soon = port.runtime.call_soon
        self.call_at = port.runtime.call_at
        self.cancel_timer = port.runtime.cancel_timer
        port.on_failure(self._on_failure)
        port.on_shutdown(self._look_at_ros)
        port.link.orphans.on_none_confirmed = self._free_if_done

    def begin(self, call: Call) -> None:
        """Count a call among those in flight, and start it soon. From any thread."""
        self.calls.add(call)
        self.call_soon(partial(self._start, call))

    def _start(self, call: Call) -> None:
        failure = self.port.runtime.failure
        if failure is not None:
            call.fail(_DIED, failure)
        elif self._closing or self.ended_because:
            # It came after the closing, and has sent nothing.
            call.close(abandon=True, because=self.ended_because or CLIENT_CLOSED)
        elif is_ending():
            call.unwanted = True  # between the signal and the process's end nothing begins
            call.start()
        elif self.port.freed.is_set():
            call.refuse("the ROS context was shut down just when the call began")
        else:
            call.start()
            if self.port.has_node and self._node_timer is None:
                self._arm_node_timer()

    # --- for calls -------------------------------------------------------------------------

    def attempt(
        self,
        goal_id: uuid.UUID,
        goal: Any,
        timeouts: Timeouts,
        deadline: float | None,
        owner: Call,
    ) -> Attempt:
        """Make an attempt, and watch it until its goal is over."""
        made = Attempt(
            self.port.link,
            goal_id,
            goal,
            timeouts,
            deadline,
            owner,
            on_out_of_sight=self._out_of_sight,
        )
        self._attempts[made] = None
        return made

    def server_is_ready(self) -> bool:
        """Whether goals can be sent now."""
        return self.port.link.readiness.ready

    def graph_snapshot(self) -> GraphSnapshot:
        """Return what the graph shows now, for an error's text."""
        return GraphSnapshot(
            self.port.actions(),
            self.port.identity.domain_id,
            self.port.middleware(),
            self.port.best_effort(),
        )

    def finished(self, call: Call) -> None:
        """Count a call out: its future is about to end."""
        self.calls.discard(call)
        self._free_if_done()

    def untold(self) -> list[GoalFacts]:
        """Return the goals that may be running, and nobody was told so. From any thread."""
        goals = [each.goal.facts for each in list(self._attempts)]
        return [goal for goal in goals if goal.may_run and not goal.told]

    @property
    def confirming(self) -> bool:
        """Whether any goal may soon be confirmed to have stopped: a server in sight may have it."""
        return any(each.goal.may_run for each in list(self._attempts))

    def given_up_at(self, orphans_at: float) -> float:
        """Return when the last of the goals that may be running was given up on.

        Args:
            orphans_at: What to take for the goals that another server has: nobody notes it.
        """
        times = [a.goal.cancelled_at for a in list(self._attempts) if a.goal.facts.may_run]
        return max([*times, orphans_at] if self.port.link.orphans.confirmed else times, default=0.0)

    # --- the end ---------------------------------------------------------------------------

    def close_calls(self) -> None:
        """End every call by the client's policy, and take no more."""
        self._closing = True
        self.port.end_waits()
        for call in list(self.calls):
            call.close(abandon=self._abandon, because=self.ended_because or CLIENT_CLOSED)

    def _look_at_ros(self) -> None:
        """End every call where the user's ROS was shut down (C2.6)."""
        if self.port.freed.is_set():
            return
        if not self.ended_because:
            self.ended_because = self.port.why_shut_down()
            if self.ended_because and self._abandon:
                self.call_at(time.monotonic() + _CTRL_C_HEARD, self.close_calls)
            elif self.ended_because:
                self.close_calls()
        self.port.end_spinning()

    def _arm_node_timer(self) -> None:
        self._node_timer = self.call_at(time.monotonic() + _NODE_CHECK, self._look_at_node)

    def _look_at_node(self) -> None:
        self._node_timer = None
        self._look_at_ros()
        if self.calls and not self.ended_because:
            self._arm_node_timer()

    def end_grace(self) -> None:
        """Wait no longer for cancellations to be confirmed: end the calls that are left."""
        for call in list(self.calls):
            call.end_grace()

    def release(self) -> None:
        """Free the port as soon as no goal has to be watched any more."""
        first, self._releasing = not self._releasing, True
        if first:
            self.port.end_waits()
        if self.port.freed.is_set():
            self._on_freed()  # as the thread died, perhaps before the closing
        elif self._done:
            self.free()
        elif first:
            self._arm_linger()
        self.released.set()

    def _arm_linger(self) -> None:
        self._linger_timer = self.call_at(time.monotonic() + LINGER, self._stop_lingering)

    def _stop_lingering(self) -> None:
        self._linger_timer = None
        if self.calls:
            self._arm_linger()  # somebody may wait for their futures
        else:
            self.free()

    def _out_of_sight(self, attempt: Attempt) -> None:
        if attempt.goal.stage is Stage.OVER:
            self._attempts.pop(attempt, None)
        elif attempt.goal.stage is Stage.LOST and len(self._attempts) > _MOST:
            self._forget_a_lost_one()
        self._free_if_done()

    def _forget_a_lost_one(self) -> None:
        oldest = next(each for each in self._attempts if each.goal.stage is Stage.LOST)
        log_later(
            logging.WARNING,
            "goal %s of action %s was lost with its server, and MAY STILL BE RUNNING: more than %d"
            " goals may run, so it is not cancelled any more if that server is seen again",
            oldest.goal_id,
            self.action_name,
            _MOST,
        )
        oldest.forget()

    @property
    def _done(self) -> bool:
        # If its server is gone, a goal is watched only for as long as the client lives (C2.4).
        watched = any(attempt.goal.stage is not Stage.LOST for attempt in self._attempts)
        return not self.calls and not watched and not self.port.link.orphans.confirmed

    def _free_if_done(self) -> None:
        if self._releasing and self._done:
            self.call_soon(self.free)  # not from within the link's own callback

    def free(self) -> None:
        """Free the port now, even if goals are in flight. Does nothing the second time."""
        if not self.port.freed.is_set():
            # The thread may live on, with other clients. A timer that is left there would keep this
            # carrier, and with it the whole client, in memory until it is due.
            if self._linger_timer is not None:
                self.cancel_timer(self._linger_timer)
                self._linger_timer = None
            if self._node_timer is not None:
                self.cancel_timer(self._node_timer)
                self._node_timer = None
            for attempt in list(self._attempts):
                attempt.drop()
            self.port.free()
            self._on_freed()

    def _on_failure(self, error: BaseException) -> None:
        self.ended_because = _DIED
        for call in list(self.calls):
            call.fail(_DIED, error)
        for attempt in list(self._attempts):
            attempt.goal.lose_touch()
        self.port.end_waits()
        # The entities died with the thread; nobody is left to free them.
        self.port.freed.set()
        self.released.set()
        self._on_freed()

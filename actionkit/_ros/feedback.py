"""The subscription to the feedback topic: its messages, and the event that tells of servers.

Everybody's feedback comes over it, and a turn of the thread costs more than taking a dozen
messages. So where messages come fast, nothing is waited for during a pause after each look. What
a result has overtaken is taken with it (R15).

The two go together for another reason. With Fast DDS both wake a wait by one condition of the
reader: whoever waits for the event alone, with messages unread, waits no time at all, and again
and again. So either both are waited for, or neither.
"""

from __future__ import annotations

from collections.abc import Callable, Container

from actionkit._ros.native import EventSource, MessageSource
from actionkit._ros.runtime import Runtime
from actionkit._ros.wire import feedback_goal_id
from actionkit._threads.clock import TimerHandle

_PAUSE = 0.002
"""Seconds; a goal may send a thousand a second."""
_PAUSE_FOR_OTHERS = 0.01
"""Seconds where all that came was others'; within the 20 ms of contract C7.4."""
_PAUSE_WHEN_IDLE = 1.0
"""Seconds where nobody waits for anything here."""
_HANDFULS = 32
"""As much as the subscription's queue holds, so that no flood can keep the thread."""


class FeedbackWatch:
    """Tells the feedback of goals, and lets nobody else's disturb. On its thread only."""

    def __init__(
        self,
        runtime: Runtime,
        messages: MessageSource,
        matched: EventSource | None,
        *,
        goals: Container[bytes],
        on_feedback: Callable[[bytes, list[bytes]], None],
        has_waiters: Callable[[], bool],
    ) -> None:
        """Wait for the event, where there is one.

        Args:
            runtime: Whose thread this is.
            messages: The subscription; `look` is to be called when it is ready.
            matched: Its event that tells of servers, or `None`.
            goals: The ids of the goals wanted; read at each message.
            on_feedback: Called with a goal's id and serialised feedback messages of it, in order.
            has_waiters: Whether anybody waits for servers coming and going.
        """
        self._runtime = runtime
        self._messages = messages
        self._matched = matched
        self._goals = goals
        self._on_feedback = on_feedback
        self._has_waiters = has_waiters
        self._on = False
        self._ours = 0  # how many messages were
        self._looked = 0.0  # when some were taken last
        self._pause: TimerHandle | None = None
        self._wait()

    def start(self) -> None:
        """Tell feedback from now on. What has come before is nobody's, however much it is."""
        if not self._on:
            self._on = True
            self._messages.discard()
            # A goal that ends within the pause costs no look: its result takes its feedback.
            self._rest(_PAUSE)

    def stop(self) -> None:
        """Tell none any more."""
        self._on = False
        self._wait()

    def poll_now(self) -> None:
        """See at once what servers there are."""
        if self._pause is not None and self._matched is not None:
            self._matched.take()
            self._wait()

    def take_all(self) -> None:
        """Take what has come."""
        for _ in range(_HANDFULS):
            if not self._take():
                return

    def look(self) -> None:
        """Take some of what has come; then pause, unless messages come one by one."""
        before = self._ours
        if not self._take():
            self._wait()
            return
        now = self._runtime.now()
        since, self._looked = now - self._looked, now
        pause = _PAUSE if self._ours > before else _PAUSE_FOR_OTHERS
        if not self._on and not self._has_waiters():
            self._rest(_PAUSE_WHEN_IDLE)
        elif since > 2 * pause:
            self._wait()
        else:
            self._rest(pause)

    def close(self) -> None:
        """Wait for nothing."""
        for source in (self._messages, self._matched):
            if source is not None:
                self._runtime.disable(source)
        if self._pause is not None:
            self._runtime.timers.cancel(self._pause)
            self._pause = None

    def _rest(self, pause: float) -> None:
        self.close()
        self._pause = self._runtime.call_at(self._runtime.now() + pause, self._end_rest)

    def _end_rest(self) -> None:
        self._pause = None
        self.look()

    def _wait(self) -> None:
        self.close()
        if self._matched is not None:
            self._runtime.enable(self._matched)
        if self._on or self._matched is not None:
            self._runtime.enable(self._messages)

    def _take(self) -> bool:
        messages = self._messages.take()
        ours: dict[bytes, list[bytes]] = {}
        for message in messages:
            goal_id = feedback_goal_id(message)
            if goal_id in self._goals:
                ours.setdefault(goal_id, []).append(message)
        for goal_id, handful in ours.items():
            self._ours += len(handful)
            self._on_feedback(goal_id, handful)
        return bool(messages)

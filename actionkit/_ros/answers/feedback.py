"""Reads the feedback topic: its messages, and the event for servers that come and go.

The topic has the feedback of all clients' goals, and a turn of the communication thread takes more
time than reading a dozen messages. So if messages come fast, the thread ignores them for a moment
after each read. When a result comes, all feedback is read first, because the result may have
overtaken some of it (R15).

With Fast DDS, one condition of the reader wakes the thread for messages and for the event. If the
thread waited only for the event while messages are unread, each wait would return at once. So it
waits either for both or for neither.
"""

from __future__ import annotations

from collections.abc import Callable, Container

from actionkit._ros.answers.wire import feedback_goal_id
from actionkit._ros.communication.runtime import Runtime
from actionkit._ros.rclpy_private.wait_set import MOST_AT_ONCE, EventSource, MessageSource
from actionkit._threads.clock import TimerHandle

_PAUSE = 0.002
"""Seconds: short for a human or a control loop, and the time of two messages at 1000 Hz."""
_FIRST_PAUSE = 0.005
"""Seconds after a goal is sent while no other runs. Most short goals are over by then, and their
feedback is read with their result. Only the first message is delayed."""
_PAUSE_FOR_OTHERS = 0.01
"""Seconds if all messages were for other clients; a server must be noticed within 20 ms (C7.4)."""
_PAUSE_WHEN_IDLE = 1.0
"""Seconds if nothing waits for feedback or servers; an idle client may wake that often (C7.4)."""
_READS = 32
"""Reads of 64 messages in a row, together the whole queue: a flood cannot block the thread."""


class FeedbackWatch:
    """Passes on the feedback of our goals. On the communication thread only."""

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
        """Wait for the event, if the middleware has it. Feedback is passed on after `start`.

        Args:
            messages: The subscription. Its source calls `look` when it is readable.
            matched: Its event for servers that come and go, or `None` if the middleware has none.
            goals: The ids of the goals wanted. Read at each message.
            on_feedback: Called with a goal's id and its serialised feedback messages, in order.
            has_waiters: Whether anything waits for servers to come or go.
        """
        self._runtime = runtime
        self._messages = messages
        self._matched = matched
        self._goals = goals
        self._on_feedback = on_feedback
        self._has_waiters = has_waiters
        self._on = False
        self._ours = 0  # how many messages were for our goals
        self._looked = 0.0  # when messages last came
        self._pause: TimerHandle | None = None
        self._wait()

    def start(self) -> None:
        """Pass on feedback from now on; ignore earlier feedback."""
        if not self._on:
            self._on = True
            self._messages.discard()
            self._start_pause(_FIRST_PAUSE)

    def stop(self) -> None:
        """Pass on no feedback until `start` is called again."""
        self._on = False
        self._wait()

    def poll_now(self) -> None:
        """Read the event now, even in a pause."""
        if self._pause is not None and self._matched is not None:
            self._matched.take()
            self._wait()

    def take_all(self) -> None:
        """Read everything that has come."""
        for _ in range(_READS):
            if self._take() < MOST_AT_ONCE:
                return

    def look(self) -> None:
        """Read some of what has come; then pause, unless messages come rarely."""
        before = self._ours
        if not self._take():
            self._wait()
            return
        now = self._runtime.now()
        since, self._looked = now - self._looked, now
        pause = _PAUSE if self._ours > before else _PAUSE_FOR_OTHERS
        if not self._on and not self._has_waiters():
            self._start_pause(_PAUSE_WHEN_IDLE)
        elif since > 2 * pause:
            self._wait()
        else:
            self._start_pause(pause)

    def close(self) -> None:
        """Wait for neither messages nor event, and end the pause."""
        for source in (self._messages, self._matched):
            if source is not None:
                self._runtime.disable(source)
        self._cancel_pause()

    def _cancel_pause(self) -> None:
        if self._pause is not None:
            self._runtime.cancel_timer(self._pause)
            self._pause = None

    def _start_pause(self, pause: float) -> None:
        self.close()
        self._pause = self._runtime.call_at(self._runtime.now() + pause, self._end_pause)

    def _end_pause(self) -> None:
        self._pause = None
        self.look()

    def _wait(self) -> None:
        self._cancel_pause()
        if self._matched is not None:
            self._runtime.enable(self._matched)
        if self._on or self._matched is not None:
            self._runtime.enable(self._messages)
        else:
            self._runtime.disable(self._messages)

    def _take(self) -> int:
        """Read messages, pass on ours, and return how many there were, ours or not."""
        messages = self._messages.take()
        ours: dict[bytes, list[bytes]] = {}
        for message in messages:
            goal_id = feedback_goal_id(message)
            if goal_id in self._goals:
                ours.setdefault(goal_id, []).append(message)
        for goal_id, its_messages in ours.items():
            self._ours += len(its_messages)
            self._on_feedback(goal_id, its_messages)
        return len(messages)

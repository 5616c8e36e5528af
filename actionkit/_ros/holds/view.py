"""Collects what one process knows about the holds in its domain, and whether that is complete."""

from __future__ import annotations

import atexit
import logging
import os
import queue
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from actionkit._model.environment.domain import environment_domain
from actionkit._ros.holds import state as states
from actionkit._ros.holds.files import HoldFiles
from actionkit._ros.holds.ours import who_we_are
from actionkit._ros.holds.state import Hold, HoldState, Sender
from actionkit._ros.holds.topic import HoldTopic, Speaker
from actionkit._threads.diagnostics import log_later

SETTLE = 4.0
"""Seconds after joining in which a process with a hold may not be in sight yet: the first messages
of Fast DDS may get lost, and it repeats them after 3 s. (Of 30 new processes, 20 knew of a hold
within 1 s, all within 3 s.)"""
_PERIOD = 1.0
"""Seconds between two looks at the graph and the files, when all is known."""
_STEP = 0.1
"""The same before that."""
_GAP = 3 * _PERIOD
"""If no look happened for this many seconds, the process was stopped or the computer slept. Then
nothing counts as known, because messages may have been lost."""
_JOIN = 5.0
"""Seconds for the thread to end."""
_FILES_DO = 10.0
"""Seconds to wait for the message of a process with the same files: it is in a file, too."""
_WORN_OUT = 30.0
"""Seconds that a process out of sight is remembered."""
_NOT_YET = "others have not all been heard yet"
_CUT_OFF = (
    "another agent or terminal is in sight, but its messages do not arrive here, as between two"
    " containers: start both with --ipc=host, or give both the same folder in ACTIONKIT_HOLD_DIR"
)
"""Unlike the reason before, this one may last."""
_RETRY = 1.0
"""Seconds until the topic is joined again after a failure."""


def _uptime() -> float:
    """Return seconds of a clock that runs while the computer sleeps, and that nobody can set."""
    return time.clock_gettime(time.CLOCK_BOOTTIME)


@dataclass(frozen=True)
class Said:
    """The last message of a process, and when we got it (`_uptime`)."""

    sender: Sender
    state: HoldState
    at: float


class HoldView:
    """Receives and publishes holds on its own thread, from `start` to `close`.

    All other methods may be called from any thread; they neither block nor raise.
    """

    def __init__(
        self,
        domain_id: int | None,
        role: str,
        *,
        speaks: bool,
        on_change: Callable[[], object] = lambda: None,
    ) -> None:
        """Take what is needed; does nothing yet.

        Args:
            domain_id: The ROS domain; `None` takes the environment's.
            role: What this process is, for people.
            speaks: Whether it tells others what it knows, and so keeps holds alive.
            on_change: Called on the view's thread when something may have changed.
        """
        self._domain_id = domain_id
        self._role = role
        self._speaks = speaks
        self._on_change = on_change
        self._texts: deque[str] = deque()
        self._wake: queue.SimpleQueue[None] = queue.SimpleQueue()
        self._lock = threading.RLock()  # never taken by the communication thread
        self._state = HoldState()
        self._heard: dict[str, Said] = {}
        self._speakers: frozenset[str] = frozenset()
        self._silent_since: dict[bytes, float] = {}
        self._topic: HoldTopic | None = None
        self._files: HoldFiles | None = None
        self._joined = 0.0
        self._looked = 0.0
        self._settled = False
        self._cut_off = False
        self._told: HoldState | None = None
        self._trouble = ""
        self._unwritten = ""
        self._stopping = False
        self._pid = os.getpid()
        self._thread = threading.Thread(target=self._main, name="actionkit-hold", daemon=True)

    # --- from any thread -------------------------------------------------------------------

    def start(self) -> None:
        """Begin to join the topic. Returns at once."""
        self._thread.start()
        # The middleware's own exit handlers crash under a thread that still uses it.
        atexit.register(self.close)

    def close(self) -> None:
        """Leave the topic, within some seconds. Harmless if called twice, or without `start`."""
        if self._pid != os.getpid():
            return  # the thread and everything it has belong to the parent
        self._stopping = True
        self._wake.put(None)
        if self._thread.ident is not None and self._thread is not threading.current_thread():
            self._thread.join(_JOIN)
            atexit.unregister(self.close)

    @property
    def state(self) -> HoldState:
        """Everything that is known now, from the topic and the files."""
        return self.known()[0]

    def known(self) -> tuple[HoldState, str]:
        """Return `state`, and why it may be incomplete; `""` if it is complete."""
        unread = self._read_files()
        # In this order: complete means that it was complete before the state was read.
        unknown = self._unknown() or unread
        return self._take_texts(), unknown

    @property
    def surely_free(self) -> bool:
        """Whether nothing is held, as far as `known` knew at most a second ago.

        Takes no lock and reads no file: the communication thread may ask.
        """
        return not (self._texts or self._unknown() or self._state.active)

    def _unknown(self) -> str:
        if self._trouble:
            return self._trouble
        if self._pid != os.getpid():
            return "this process was forked from the one that listened"
        if not self._settled or _uptime() - self._looked > _GAP:
            return _CUT_OFF if self._cut_off else _NOT_YET
        return ""

    @property
    def has_told(self) -> bool:
        """Whether it has joined the topic and published what it knew then."""
        return self._told is not None

    @property
    def others(self) -> list[Said]:
        """The last messages of the other processes in sight."""
        with self._lock:
            topic = self._topic
            own = topic.node_name if topic is not None else ""
            return [
                said for node, said in self._heard.items() if node != own and self._in_sight(node)
            ]

    def in_files(self, holds: Iterable[Hold]) -> bool:
        """Whether the files on this computer say that one of these holds lasts."""
        try:
            told = self._files.read() if self._files is not None else HoldState()
        except OSError:
            return False
        return any(hold.hold_id in told.holds for hold in holds)

    @property
    def unwritten(self) -> str:
        """Why a hold does not get into the files; `""` if nothing is known to be wrong."""
        return self._unwritten or self._read_files()

    def add(self, state: HoldState) -> None:
        """Add this to the state, and publish it."""
        with self._lock:
            self._state = states.merged(self._state, state)
        self._wake.put(None)

    def release(self, holds: tuple[Hold, ...]) -> None:
        """Release these holds, and publish it."""
        with self._lock:
            self._state = states.released(self._state, holds)
        self._wake.put(None)

    # --- putting together what is known ----------------------------------------------------

    def _on_text(self, text: str) -> None:
        self._texts.append(text)
        self._wake.put(None)

    def _take_texts(self) -> HoldState:
        with self._lock:  # so that no text is missing between its removal and its merge
            while self._texts:  # taken out only after that: until then, nothing is surely free
                state, sender = states.decode(self._texts[0])
                self._state = states.merged(self._state, state)
                if sender is not None:
                    self._heard[sender.node] = Said(sender, state, _uptime())
                self._texts.popleft()
            return self._state

    def _read_files(self) -> str:
        """Add the state in the files; return what was wrong with them."""
        try:
            state = self._own_files().read()
        except (OSError, ValueError) as error:
            return f"{type(error).__name__}: {error}"
        if state:
            with self._lock:
                self._state = states.merged(self._state, state)
        return ""

    def _own_files(self) -> HoldFiles:
        if self._files is None:
            self._files = HoldFiles(self._domain())
        return self._files

    def _domain(self) -> int:
        """Return the domain: the first one is kept, even if the environment changes."""
        if self._domain_id is None:
            self._domain_id = environment_domain()
        return self._domain_id

    def _in_sight(self, node: str) -> bool:
        return node in self._speakers

    # --- on its thread ---------------------------------------------------------------------

    def _main(self) -> None:
        before: object = None
        while not self._stopping:
            try:
                self._trouble = self._look()
                wait = _PERIOD if self._settled else _STEP
            except Exception as error:  # noqa: BLE001  after any error, nothing counts as known
                self._trouble = f"{type(error).__name__}: {error}"
                self._leave()
                wait = _RETRY
            # First our own code, then other processes, and the disk last, because it may be slow.
            now = self._take_texts(), self._unknown(), self._speakers
            if now != before:
                before = now
                self._guarded(self._on_change)
            self._guarded(self._tell)
            self._guarded(self._write)
            self._sleep(wait)
        self._guarded(self._tell)
        self._guarded(self._write)
        self._leave()

    def _guarded(self, step: Callable[[], object]) -> None:
        try:
            step()
        except Exception:  # noqa: BLE001  the other steps must go on
            log_later(logging.DEBUG, "an error beside the hold", exc_info=True)

    def _sleep(self, seconds: float) -> None:
        try:
            self._wake.get(timeout=seconds)
            while True:
                self._wake.get_nowait()
        except queue.Empty:
            return

    def _look(self) -> str:
        if self._topic is not None and not self._topic.usable:
            self._leave()
        now = _uptime()
        if self._topic is None:
            files = self._own_files().shared_by()
            self._topic = HoldTopic(self._domain(), self._on_text, speaks=self._speaks, files=files)
            self._joined = now = _uptime()
        elif now - self._looked > _GAP:
            # We were away: messages may have been lost, and others may not see us any more.
            self._joined = now
            self._settled = False
        unread = self._read_files()
        speakers = self._topic.speakers()
        self._speakers = frozenset(speaker.node for speaker in speakers)
        self._take_texts()
        self._forget(now)
        silent = self._who_is_silent(speakers, self._topic.node_name, now)
        self._settled = now - self._joined >= SETTLE and not silent
        self._looked = now
        return unread

    def _who_is_silent(self, speakers: list[Speaker], own: str, now: float) -> bool:
        """Whether a process in sight may know a hold, and has not sent it."""
        silent = [s for s in speakers if s.node != own and s.node not in self._heard]
        self._silent_since = {s.gid: self._silent_since.get(s.gid, now) for s in silent}
        long = [s for s in silent if now - self._silent_since[s.gid] >= _FILES_DO]
        # Agents of two users on one computer never get each other's messages; they use the files.
        self._cut_off = not all(s.shares_files for s in long)
        return self._cut_off or len(silent) > len(long)

    def _forget(self, now: float) -> None:
        with self._lock:
            for node, said in list(self._heard.items()):
                if not self._in_sight(node) and now - said.at > _WORN_OUT:
                    del self._heard[node]

    def _tell(self) -> None:
        state = self._take_texts()
        if self._speaks and self._topic is not None and state != self._told:
            sender = Sender(self._topic.node_name, self._role, who_we_are(), os.getpid())
            self._topic.say(states.encode(state, sender))
            self._told = state

    def _write(self) -> None:
        if self._speaks and self._files is not None:
            try:
                self._files.write(self._take_texts())
                self._unwritten = ""
            except OSError as error:
                # It is tried again at the next look.
                place = f"{self._files.directory}: {error.strerror}"
                self._unwritten = place if error.strerror else str(error)

    def _leave(self) -> None:
        topic, self._topic = self._topic, None
        self._told = None
        self._settled = False
        if topic is not None:
            self._guarded(topic.close)

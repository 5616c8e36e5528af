"""Sets, shows and releases the hold, for `actionkit stop`."""

from __future__ import annotations

import contextlib
import os
import subprocess
import threading
import time
from collections.abc import Sequence
from typing import TYPE_CHECKING

from actionkit._model.environment.domain import environment_domain
from actionkit._model.environment.own_module import command_for
from actionkit._ros.holds.state import Hold, HoldState, encode
from actionkit._ros.holds.words import since
from actionkit.cli._shared.exits import Exit
from actionkit.cli._shared.say import say
from actionkit.cli.watch._hold_lines import hold_line

if TYPE_CHECKING:
    from actionkit._ros.holds.view import HoldView

_LOOK = 0.1
"""Seconds between two looks while others are being told."""
TOO_SLOW = "the disk is too slow"
"""Why something is not in a file if no error came."""


class Keeper:
    """The process that keeps a hold, started in the background."""

    def __init__(self, hold: Hold) -> None:
        """Start the process, and write the hold to a file; neither may delay the next step."""
        state = HoldState({hold.hold_id: hold})
        # So processes of this computer know of it before discovery. On a thread, because a disk
        # may be slow.
        threading.Thread(target=_write_file, args=(state,), daemon=True).start()
        self._text = b""
        self._process: subprocess.Popen[bytes] | None = None
        with contextlib.suppress(OSError):  # no more processes: `is_ready` reports it
            self._process = subprocess.Popen(
                command_for("actionkit.cli.cancel_and_stop._keeper"),
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                start_new_session=True,
            )
            assert self._process.stdin is not None
            self._process.stdin.write(encode(state).encode())
            self._process.stdin.close()
            assert self._process.stdout is not None
            os.set_blocking(self._process.stdout.fileno(), False)  # two threads ask `is_ready`

    @property
    def pid(self) -> int | None:
        """The number of its process, or `None`."""
        return None if self._process is None else self._process.pid

    def is_ready(self) -> bool:
        """Return whether it publishes the hold by now."""
        from actionkit.cli.cancel_and_stop._keeper import READY

        if self._process is None:
            return False
        assert self._process.stdout is not None
        descriptor = self._process.stdout.fileno()
        with contextlib.suppress(BlockingIOError):  # there is nothing more yet
            while more := os.read(descriptor, 4096):
                self._text += more
        return READY.encode() in self._text.split() and self._process.poll() is None


def _write_file(state: HoldState) -> None:
    from actionkit._ros.holds.files import HoldFiles

    with contextlib.suppress(OSError, ValueError):  # the second defence; the view reports it
        HoldFiles(environment_domain()).write(state)


def agents_told(view: HoldView) -> tuple[list[str], list[str]]:
    """Return the agents in sight that have said that they are held, and those that have not."""
    held = {hold.hold_id for hold in view.state.active}
    agents = [said for said in view.others if said.sender.role == "agent"]
    knowing = [str(said.sender) for said in agents if held & set(said.state.holds)]
    others = [str(said.sender) for said in agents if not held & set(said.state.holds)]
    return sorted(knowing), sorted(others)


def show_status(view: HoldView, timeout: float, *, as_json: bool) -> Exit:
    """Show whether there is a hold, who has set it, and what keeps it."""
    _await_known(view, timeout)
    state, unknown = view.known()
    keepers = _keepers(view, state.active)
    if as_json:
        held = True if state.active else None if unknown else False
        say(hold_line(held, state.active, kept_by=keepers, unknown=unknown))
    elif state.active:
        for hold in state.active:
            say(f"Held by {hold.by}{since(hold)}.")
        say(f"Kept by {', '.join(keepers) or 'nothing that is in sight any more'}.")
        say("`actionkit stop --release` ends it.")
    elif not unknown:
        say("Not held.")
    if unknown:
        say(f"Error: It is not known whether there is another hold: {unknown}.", err=True)
    return Exit.HELD if state.active else Exit.FAILED if unknown else Exit.OK


def release(view: HoldView, timeout: float, *, as_json: bool) -> Exit:
    """End every hold, and wait until every process in sight knows it.

    A later stop is not released: when everything is known, a new hold stays.
    """
    ended: dict[str, Hold] = {}
    complete = False
    until = time.monotonic() + timeout
    while True:
        state, unknown = view.known()
        new = tuple(hold for hold in state.active if complete and hold.hold_id not in ended)
        if state.active and not new:
            ended.update({hold.hold_id: hold for hold in state.active})
            view.release(state.active)
        complete = complete or not unknown
        late = [str(said.sender) for said in view.others if set(said.state.holds) & set(ended)]
        over = time.monotonic() >= until
        if over or new or not (state.active or unknown or late):
            break
        time.sleep(_LOOK)
    view.close()  # it writes the release to a file, at the latest now
    unwritten = (view.unwritten or TOO_SLOW) if view.in_files(ended.values()) else ""
    if as_json:
        told = new or tuple(ended.values())
        say(hold_line(bool(new), told, late=late, unknown=unknown, unwritten=unwritten))
    for hold in () if as_json else ended.values():
        say(f"Released: the hold of {hold.by}{since(hold)}.")
    if not ended and not unknown and not as_json:
        say("There was no hold.")
    for hold in new:
        say(f"Error: {hold.by} has stopped the robot meanwhile; that hold stays.", err=True)
    for who in late:
        say(
            f"Error: The {who} has not confirmed it, and may go on holding. Try again later.",
            err=True,
        )
    if unknown:
        say(f"Error: There may be more holds: {unknown}. Try again.", err=True)
    if unwritten:
        say(
            f"Error: A file on this computer still has the hold ({unwritten}). Agents that start"
            " later are held. Mend that, and try again.",
            err=True,
        )
    return Exit.HELD if new else Exit.FAILED if late or unknown or unwritten else Exit.OK


def _await_known(view: HoldView, timeout: float) -> None:
    until = time.monotonic() + timeout
    while view.known()[1] and time.monotonic() < until:
        time.sleep(_LOOK)


def _keepers(view: HoldView, holds: Sequence[Hold]) -> list[str]:
    names = {hold.hold_id for hold in holds}
    keepers = [str(said.sender) for said in view.others if names & set(said.state.holds)]
    files = ["a file on this computer"] if view.in_files(holds) else []
    return sorted(keepers) + files


def line_of(view: HoldView, **more: object) -> str:
    """Return the line of JSON about the hold as it is known now."""
    state, unknown = view.known()
    held = True if state.active else None if unknown else False
    return hold_line(held, state.active, **more)

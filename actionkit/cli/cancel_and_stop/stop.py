"""`actionkit stop`: cancel every goal of every action, and hold agents until it is released."""

from __future__ import annotations

import contextlib
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from functools import partial
from typing import TYPE_CHECKING

import click

from actionkit._model.environment.domain import LAST_DOMAIN
from actionkit._observers.json_schema import note_line
from actionkit._ros.cancelling.cancel_goals import cancel_goals
from actionkit._ros.cancelling.cancelling import Cancelling
from actionkit._ros.workarounds.udp_only import use_udp_only
from actionkit.cli._shared.exits import Exit
from actionkit.cli._shared.no_server import nothing_there
from actionkit.cli._shared.options import HELP, SECONDS, complete_names, debug_option, json_option
from actionkit.cli._shared.problems import full_name, import_ros, open_survey
from actionkit.cli._shared.say import say
from actionkit.cli._shared.stdout import keep_clean
from actionkit.cli.cancel_and_stop._stop_table import exit_of, say_error, table, worst

if TYPE_CHECKING:
    from actionkit._ros.holds.state import Hold
    from actionkit._ros.holds.view import HoldView
    from actionkit.cli.cancel_and_stop._holding import Keeper

_LOOK = 4.0
"""Seconds to look for servers: a server that is not seen at once is seen within 3 s. By then,
agents in sight know of the hold, too, so they send no more goals."""
_NAMED = 1.0
"""The same if the actions are named and each has a server: there may be a second one."""
_TICK = 0.05
"""Seconds between two looks at the graph."""
_GRACE = 5.0
"""More seconds at most to wait for the agents when the goals are stopped."""
_LEAST = 1.0
"""Seconds for the hold to be kept, also if --timeout is less."""

_EPILOG = """\b
Examples:
  actionkit stop
  actionkit stop --status
  actionkit stop --release
  actionkit stop /navigate_to_pose

Goals are canceled whoever sent them. Then agents (`actionkit mcp`, actionkit.agents.Toolbox) send
none until `actionkit stop --release`, by anybody in the ROS domain; other programs may. With NAMEs,
only these actions are canceled, and agents are not held. This is no emergency stop in the sense of
a safety norm. The exit code is 0 where every goal is known to run no more and agents are held, 22
where a server refused, 23 where a goal may still be running, 14 where no server was in sight, and 1
where the hold may not last, as where no file could be written. --status ends with 0 where there is
no hold, with 25 where there is one, and with 1 where that is not known."""


def _set_domain(ctx: click.Context, param: click.Parameter, value: int | None) -> None:
    if value is not None and not ctx.resilient_parsing:
        os.environ["ROS_DOMAIN_ID"] = str(value)


@click.command("stop", context_settings=HELP, epilog=_EPILOG)
@click.argument("names", metavar="[NAME]...", nargs=-1, shell_complete=complete_names)
@click.option("--release", "releasing", is_flag=True, help="Let agents send goals again.")
@click.option("--status", "status", is_flag=True, help="Tell whether agents are held, and by whom.")
@click.option(
    "--timeout",
    type=SECONDS,
    default=10.0,
    show_default=True,
    help="How long to wait in all, for all servers together. To find them takes 4 s at least.",
)
@click.option(
    "--domain-id",
    type=click.IntRange(0, LAST_DOMAIN),
    expose_value=False,
    callback=_set_domain,
    help="The ROS domain, in place of the environment's.",
)
@json_option("Write one JSON object for each goal, each action, and the hold.")
@debug_option
def command(
    names: tuple[str, ...], releasing: bool, status: bool, timeout: float, as_json: bool
) -> int:
    """Cancel every goal of every action in sight, and hold agents until --release."""
    if releasing and status:
        raise click.UsageError("Give --release or --status, not both.")
    if names and (releasing or status):
        raise click.UsageError("Give NAMEs or an option, not both: a hold is for all actions.")
    use_udp_only()
    keep_clean()
    if releasing or status:
        return _about_hold(releasing, timeout, as_json)
    # The robot is stopped even if the terminal is closed.
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    if names:
        return _stop_named(names, timeout, as_json)
    return _stop_all(timeout, as_json)


def _about_hold(releasing: bool, timeout: float, as_json: bool) -> int:
    import_ros()
    from actionkit._ros.holds.view import HoldView
    from actionkit.cli.cancel_and_stop._holding import release, show_status

    view = HoldView(None, "release" if releasing else "status", speaks=releasing)
    view.start()
    try:
        return (release if releasing else show_status)(view, timeout, as_json=as_json)
    finally:
        view.close()


def _stop_named(names: tuple[str, ...], timeout: float, as_json: bool) -> int:
    with open_survey() as survey:
        full = list(dict.fromkeys(full_name(survey, name) for name in names))
        stopped = [Cancelling(name) for name in full]
        with _shown(stopped, as_json):
            cancel_goals(
                survey,
                stopped,
                over=_passed(timeout),
                look=_LOOK,
                least=_NAMED,
                on_error=say_error,
            )
        missing = [action.name for action in stopped if not action.has_server]
        for name in missing:
            say(f"Error: {nothing_there(name, survey.actions())}", err=True)
        codes = [exit_of(action) if action.has_server else Exit.NO_SERVER for action in stopped]
    say("Agents are not held: `actionkit stop` without names does that, too.", err=True)
    return worst(codes)


def _stop_all(timeout: float, as_json: bool) -> int:
    from actionkit._ros.holds.ours import new_hold
    from actionkit.cli.cancel_and_stop._holding import Keeper

    hold = new_hold()
    # First, and at the same time as the rest: agents must not send the canceled goals again.
    keeper = Keeper(hold)
    try:
        return _stop_and_hold(hold, keeper, timeout, as_json)
    except BaseException:  # also after Ctrl-C: a human must know of the hold
        say("The hold stays. `actionkit stop --release` ends it.", err=True)
        raise


def _stop_and_hold(hold: Hold, keeper: Keeper, timeout: float, as_json: bool) -> int:
    with open_survey() as survey:
        from actionkit._ros.holds.state import HoldState
        from actionkit._ros.holds.view import HoldView

        view = HoldView(None, "stop", speaks=True)
        view.add(HoldState({hold.hold_id: hold}))
        view.start()
        until = time.monotonic() + max(timeout, _LEAST)
        first = f"Stopping everything in ROS domain {survey.domain_id}."
        stopped: list[Cancelling] = []
        held = partial(_are_held, view, hold, keeper)
        try:
            with _shown(stopped, as_json), _said_beside(first, held):
                cancel_goals(survey, stopped, over=_passed(timeout), look=_LOOK, on_error=say_error)
            codes = [exit_of(action) for action in stopped] or [Exit.NO_SERVER]
            if not stopped:
                say("No action server is in sight, so nothing was canceled.", err=True)
            until = min(until, time.monotonic() + _GRACE)
            while time.monotonic() < until and not (held() and (_in_file(view) or view.unwritten)):
                time.sleep(_TICK)
            codes.append(_tell_of_hold(view, hold, keeper, as_json))
        finally:
            view.close()
    return worst(codes)


def _passed(timeout: float) -> Callable[[float], bool]:
    until = time.monotonic() + timeout
    return lambda now: now >= until


@contextlib.contextmanager
def _said_beside(first: str, held: Callable[[], bool]) -> Iterator[None]:
    """Say a line, and that agents are held as soon as it is so."""
    over = threading.Event()

    def look() -> None:
        with contextlib.suppress(OSError):  # the terminal was closed
            say(first, err=True)
            while not over.wait(_TICK):
                if held():
                    say("Agents are held.", err=True)
                    return

    # On a thread: a terminal that shows nothing, or a slow disk, must not hold up the stop.
    thread = threading.Thread(target=look, daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join(_LEAST)


def _are_held(view: HoldView, hold: Hold, keeper: Keeper) -> bool:
    from actionkit.cli.cancel_and_stop._holding import agents_told

    late = agents_told(view)[1]
    return not late and bool(view.state.active) and _is_kept(view, hold, keeper)


def _is_kept(view: HoldView, hold: Hold, keeper: Keeper) -> bool:
    active = view.state.active
    # If the same human has stopped again meanwhile, that hold replaces this one.
    return keeper.is_ready() or bool(active and hold not in active)


def _in_file(view: HoldView) -> bool:
    return view.in_files(view.state.active)


def _tell_of_hold(view: HoldView, hold: Hold, keeper: Keeper, as_json: bool) -> Exit:
    from actionkit.cli.cancel_and_stop._holding import TOO_SLOW, agents_told, line_of

    ready = keeper.is_ready()
    knowing, late = agents_told(view)
    active = view.state.active
    kept = _is_kept(view, hold, keeper)
    unwritten = "" if _in_file(view) else view.unwritten or TOO_SLOW
    if as_json:
        kept_by = keeper.pid if ready else None
        say(line_of(view, kept_by=kept_by, told=knowing, late=late, unwritten=unwritten))
    elif active:
        in_sight = f"; {len(knowing)} in sight obey." if knowing else "; none is in sight."
        say(f"Agents are held until `actionkit stop --release`{in_sight}")
    for who in late if active else ():
        say(f"Error: The {who} has not confirmed that it is held.", err=True)
    if not active:
        say("Somebody has released the hold meanwhile.", err=True)
        return Exit.FAILED
    if not kept:
        say(
            "Error: The process that keeps the hold has not come up. The hold lasts only while a"
            " file on this computer, or an agent that knows of it, tells of it.",
            err=True,
        )
    if unwritten:
        process = f"process {keeper.pid}, which this command leaves behind, or " if ready else ""
        say(
            f"Error: The hold is not in a file on this computer ({unwritten}). Without a file it"
            f" lasts only while {process}an agent that knows of it runs. Agents that start after"
            " that send goals.",
            err=True,
        )
    return Exit.FAILED if late or unwritten or not kept else Exit.OK


@contextlib.contextmanager
def _shown(actions: list[Cancelling], as_json: bool) -> Iterator[None]:
    """Show what happened to the actions at the end, also after Ctrl-C."""
    try:
        yield
    finally:
        now = time.monotonic()
        for action in actions:
            action.settle(now, over=True)
            if action.gets_more(now):
                more = "new goals came in until the end. Stop the program that sends them, too."
                say(f"{action.name}: {more}", err=True)
        actions.sort(key=lambda action: action.name)
        if as_json:
            for line in _json_lines(actions):
                say(line)
        else:
            for line in table(actions) if actions else ():
                say(line)


def _json_lines(actions: list[Cancelling]) -> Iterator[str]:
    now = time.time()
    for action in actions:
        for fate in action.fates:
            told = {"goal_id": fate.goal_id, "cancel": fate.cancel, "state": fate.state or None}
            yield note_line("cancel", action.name, now, **told, detail=fate.text)
        yield note_line(
            "stop",
            action.name,
            now,
            servers=action.servers,
            goals=len(action.fates) if action.fates or not action.silent else None,
            answered=not action.silent and not action.missing,
        )

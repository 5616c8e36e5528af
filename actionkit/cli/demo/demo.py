"""`actionkit demo`: show what ActionKit does, on a real action server, in about ten seconds."""

from __future__ import annotations

import inspect
import os
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

import click

from actionkit.cli._shared.exits import Exit
from actionkit.cli._shared.problems import import_ros
from actionkit.cli.demo._screen import DemoScreen
from actionkit.servers import Server, start
from actionkit.testing import isolated_domain

if TYPE_CHECKING:
    from actionkit.cli.demo._steps import Demo

_PERIOD = 0.25
"""Seconds that the server takes for each number: slow enough to watch, and ten numbers in 2.5 s."""
# Each of these could connect to other machines, with any discovery range.
_LEADING_OUT = ("ROS_LOCALHOST_ONLY", "ROS_STATIC_PEERS", "ROS_DISCOVERY_SERVER")


@click.command("demo")
def command() -> int:
    """Show what ActionKit does, on an action server of its own (10 s)."""
    screen = DemoScreen()
    import_ros("test_msgs.action")
    began = time.monotonic()
    with isolated_domain() as domain:
        _isolate(domain)
        try:
            server = start("fibonacci", period=_PERIOD)
        except RuntimeError as error:
            screen.failure(str(error))
            return Exit.FAILED
        with server:
            return _show(server, screen, domain, began)


def _isolate(domain: int) -> None:
    """Separate this process, and the server that it starts, from all other nodes."""
    os.environ["ROS_DOMAIN_ID"] = str(domain)
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    for name in _LEADING_OUT:
        os.environ.pop(name, None)


def _show(server: Server, screen: DemoScreen, domain: int, began: float) -> int:
    """Run all steps; return the exit code."""
    # Not at the top, because these import rclpy's messages.
    from actionkit.cli.demo._steps import STEPS, Demo, connect

    screen.heading("ActionKit demo")
    screen.text(
        f"A Fibonacci action server now runs as another process ({server.pid}). It computes a"
        f" number every {_PERIOD:g} s and sends the sequence so far as feedback. It runs in ROS"
        f" domain {domain}, on this machine only, so nothing here can reach a robot. Each step"
        " shows the code that runs, and behind -> what it printed."
    )
    screen.code(connect)
    failed = []
    with connect() as client:
        for number, (shown, run) in enumerate(STEPS, 1):
            title, _, why = inspect.cleandoc(shown.__doc__ or "").partition("\n\n")
            screen.heading(f"{number}. {title}")
            screen.text(why)
            screen.code(shown)
            if not _came_out(run, Demo(client, server, screen)):
                failed.append(title)
    screen.text("")
    if failed:
        titles = "; ".join(failed)
        screen.failure(f"{len(failed)} of {len(STEPS)} steps did not come out right: {titles}.")
        return Exit.FAILED
    seconds = time.monotonic() - began
    screen.text(f"All {len(STEPS)} steps came out as they should, in {seconds:.1f} s.", "bold")
    return Exit.OK


def _came_out(run: Callable[[Demo], None], demo: Demo) -> bool:
    """Run a step; return whether its result was as expected."""
    began = time.monotonic()
    try:
        if not demo.server.alive:
            raise RuntimeError(f"the server process has ended: {demo.server.stderr.strip()}")
        run(demo)
    except Exception as error:  # noqa: BLE001  any error is shown, and fails the demo
        demo.screen.failure(f"{type(error).__name__}: {error}")
        return False
    finally:
        demo.screen.end_progress()
    demo.screen.note(f"({time.monotonic() - began:.1f} s)")
    return True

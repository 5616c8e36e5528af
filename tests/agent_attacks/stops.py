"""Stops, races and limits: holds, ends in some phases, too many at once, broken lines."""

from __future__ import annotations

import asyncio
import random
import signal
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from functools import partial
from typing import Any

from actionkit.agents import Toolbox
from actionkit.servers import Server
from tests.agent_attacks.places import Peer, Place, left_running, orders, received, tried, unclean
from tests.waiting import until

PATROL = "never_finishes"
ROUNDS = 100
"""Of a hold and a goal at the same moment."""

# -- a process ends, in each phase of a call ---------------------------------------------------


def _sent(peer: Peer, server: Server, since: float) -> None:
    peer.call("patrol")


def _asked(peer: Peer, server: Server, since: float) -> None:
    peer.call("late", order=5)
    until(lambda: received(server, since), "the server is asked")


def _cancels(peer: Peer, server: Server, since: float) -> None:
    number = peer.call("stubborn")
    until(server.running, "it runs")
    before = server.count("cancel_requested")
    peer.send({"method": "notifications/cancelled", "params": {"requestId": number}})
    server.wait_for("cancel_requested", count=before + 1)


PHASES: dict[str, tuple[str, Callable[[Peer, Server, float], None]]] = {
    "the call is on its way": (PATROL, _sent),
    "the server has not accepted yet": ("slow_accept", _asked),
    "the goal is being cancelled": ("slow_cancel", _cancels),
}


def _twice(peer: Peer) -> None:
    peer.serving.signal(signal.SIGTERM)
    peer.serving.signal(signal.SIGTERM)


ENDS: dict[str, Callable[[Peer], None]] = {
    "the host closes standard input": Peer.hang_up,
    "SIGTERM twice": _twice,
    "SIGINT and end of input": lambda peer: (peer.serving.signal(signal.SIGINT), peer.hang_up())[0],
}


def _ends(place: Place, phase: str, end: str) -> str:
    name, arrive = PHASES[phase]
    server, since = place.robot.server(name), time.monotonic()
    with Peer(place) as peer:
        arrive(peer, server, since)
        ENDS[end](peer)
        if not peer.serving.is_gone(5.0):
            return "it does not end within 5 s"
        left = asyncio.run(left_running(server, since, 8.0))
        said = peer.errors.read_text()
        unnamed = [goal for goal in left if goal not in said]
        return f"nobody names {unnamed}: {said[-300:]}" if unnamed else ""


# -- lines over stdio that no client would send ------------------------------------------------

_CALL = '"method":"tools/call","params":{"name":"count","arguments":{"order":3}}'
_ONE = '{"jsonrpc":"2.0","id":900,%s}'
# fmt: off
LINES: dict[str, str] = {
    "a call as a notification": f'{{"jsonrpc":"2.0",{_CALL}}}',
    "a call with no id": f'{{"jsonrpc":"2.0","id":null,{_CALL}}}',
    "an array for an id": f'{{"jsonrpc":"2.0","id":[1],{_CALL}}}',
    "a bool for an id": f'{{"jsonrpc":"2.0","id":true,{_CALL}}}',
    "a fraction for an id": f'{{"jsonrpc":"2.0","id":1.5,{_CALL}}}',
    "a batch": "[{0}, {0}]".format(_ONE % _CALL),
    "another JSON-RPC": f'{{"jsonrpc":"1.0","id":803,{_CALL}}}',
    "no JSON-RPC": f'{{"id":804,{_CALL}}}',
    "two calls in a line": (_ONE % _CALL) * 2,
    "a call in a comment": f"// {_CALL}",
    "half a call": f'{{"jsonrpc":"2.0","id":807,{_CALL}',
    "a method that is no string": _ONE % '"method":1,"params":{}',
    "a method of Python": _ONE % '"method":"__import__","params":{}',
    "parameters that are an array": _ONE % '"method":"tools/call","params":["count",{"order":3}]',
    "a name that is no string": _ONE % '"method":"tools/call","params":{"name":1}',
    "no parameters": _ONE % '"method":"tools/call"',
    "meta that is no object": _ONE % '"method":"tools/call","params":{"name":"count","_meta":7}',
    "a cancel of all": '{"jsonrpc":"2.0","method":"notifications/cancelled",'
    '"params":{"requestId":"*"}}',
    "a cancel of nothing": '{"jsonrpc":"2.0","method":"notifications/cancelled","params":{}}',
    "a prompt": _ONE % '"method":"prompts/get","params":{"name":"x"}',
    "a resource": _ONE % '"method":"resources/read","params":{"uri":"file:///etc/passwd"}',
    "a level of the log": _ONE % '"method":"logging/setLevel","params":{"level":"debug"}',
    "a hello again": _ONE % '"method":"initialize","params":{"protocolVersion":"9999-99-99"}',
    "zeros": "\0" * 1000,
    "a line of 8 MB": "x" * 8_000_000,
}
# fmt: on


def _line(place: Place, peer: Peer, line: str) -> str:
    since = time.monotonic()
    peer.messages.clear()
    peer.send_line(line)
    peer.ask("ping", {})
    peer.ask("tools/call", {"name": "goals", "arguments": {}})
    # A goal of the line would have reached the server before this one's end.
    peer.ask("tools/call", {"name": "count", "arguments": {"order": 1}})
    if (got := orders(place.robot.server("fibonacci"), since)) != [1]:
        return f"goals {got} were sent"
    return "".join(map(unclean, peer.messages))


# -- a toolbox ---------------------------------------------------------------------------------

Attack = Callable[[Place, Toolbox], Awaitable[str]]


async def _hold_races(place: Place, toolbox: Toolbox) -> str:
    """Hold the robot and send a goal at the same moment, again and again."""
    server, chance, began = place.robot.server(PATROL), random.Random(7), time.monotonic()
    for _ in range(2):  # the second takes as long as all others
        calling, began = asyncio.ensure_future(toolbox.call("patrol")), time.monotonic()
        await asyncio.to_thread(until, partial(received, server, began))
        took = time.monotonic() - began
        await toolbox.cancel_all()
        await calling
    sent = 0
    for _ in range(ROUNDS):
        since = time.monotonic()
        calling = asyncio.ensure_future(toolbox.call("patrol"))
        await asyncio.sleep(chance.uniform(0.0, 1.5 * took))
        held = await asyncio.to_thread(place.stop)
        value = dict((await asyncio.wait_for(calling, 20.0)).value)
        late = list(received(server, held + 0.05))
        left = await left_running(server, since)
        sent += bool(received(server, since))
        if late or left or value["status"] not in ("canceled", "refused"):
            return f"sent under the hold: {late}, left: {left}: {value}"
        await asyncio.to_thread(place.free)
    return "" if 0 < sent < ROUNDS else f"no race: {sent} of {ROUNDS} were sent"


async def _cancel_races(place: Place, toolbox: Toolbox) -> str:
    server, chance, since = place.robot.server(PATROL), random.Random(8), time.monotonic()
    for _ in range(30):
        calling = asyncio.ensure_future(toolbox.call("patrol"))
        await asyncio.sleep(chance.uniform(0.0, 0.4))
        calling.cancel()
        await asyncio.wait([calling], timeout=10.0)
        if not calling.done():
            return "the cancelled call does not end"
    return f"left: {left}" if (left := await left_running(server, since)) else ""


async def _all_at_once(place: Place, toolbox: Toolbox) -> str:
    async def yes(_: Any) -> bool:
        return True

    server, since = place.robot.server(PATROL), time.monotonic()
    names = ("patrol", "patrol2", "ask_patrol") * 10
    calls = [asyncio.ensure_future(toolbox.call(name, approve=yes)) for name in names]
    await asyncio.wait(calls, timeout=20.0, return_when=asyncio.FIRST_EXCEPTION)
    refused = sum(one.done() and one.result().value["status"] == "refused" for one in calls)
    got = received(server, since)
    await toolbox.cancel_all()
    await asyncio.wait(calls)
    left = await left_running(server, since)
    right = (len(got), refused, server.max_running) == (1, 29, 1) and not left
    wrong = f"{got} sent, {refused} refused, {server.max_running} at a time, left: {left}"
    return "" if right else wrong


TOOLBOX: dict[str, Attack] = {
    f"a hold and a goal at the same moment, {ROUNDS} times": _hold_races,
    "cancelling at any moment, 30 times": _cancel_races,
    "thirty calls of three tools at once, one may run": _all_at_once,
}


async def attacks(place: Place) -> AsyncIterator[tuple[str, str]]:
    """Yield the name of each attack, and what is wrong, `""` where it failed."""
    for name, options in (
        ("fibonacci", {"period": 0.02}),
        (PATROL, {}),
        ("slow_accept", {"delay": 1.0, "period": 0.3}),
        ("slow_cancel", {}),
    ):
        place.robot.server(name, **options)
    async with Toolbox.from_file(place.robot.file, domain_id=place.robot.domain) as toolbox:
        with Peer(place) as peer:
            for name, line in LINES.items():
                yield f"stdio: {name}", await tried(_line, place, peer, line)
        for name, attack in TOOLBOX.items():
            yield f"Toolbox: {name}", await tried(attack, place, toolbox)
    for phase in PHASES:
        for end in ENDS:
            yield f"{phase}: {end}", await tried(_ends, place, phase, end)

"""Stops, races and limits: holds, ends in every phase, too many at once, outcomes, broken lines."""

from __future__ import annotations

import asyncio
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import suppress
from functools import partial
from typing import Any

from actionkit.agents import Toolbox
from actionkit.servers import Server
from tests.agent_attacks.places import (
    Peer,
    Place,
    ended,
    left_running,
    orders,
    received,
    tried,
    unclean,
    value_of,
)
from tests.waiting import until

ROUNDS = 100
"""Of a hold and a goal at the same moment."""

# -- a process ends, in each phase of a call ---------------------------------------------------


def _started(peer: Peer, server: Server, since: float) -> None:
    """Say everything at once, before the process has read a word."""


def _sent(peer: Peer, server: Server, since: float) -> None:
    peer.call("sent")


def _waits(peer: Peer, server: Server, since: float) -> None:
    peer.call("absent")
    until(lambda: value_of(peer.answer(peer.call("goals")))["goals"], "the goal that waits")


def _asked(peer: Peer, server: Server, since: float) -> None:
    peer.call("late", order=5)
    until(lambda: received(server, since), "the server is asked")


def _runs(peer: Peer, server: Server, since: float) -> None:
    peer.call("runs")
    until(server.running, "it runs")


def _cancels(peer: Peer, server: Server, since: float) -> None:
    number = peer.call("stubborn")
    until(server.running, "it runs")
    before = server.count("cancel_requested")
    peer.send({"method": "notifications/cancelled", "params": {"requestId": number}})
    server.wait_for("cancel_requested", count=before + 1)


PHASES: dict[str, tuple[str, Callable[[Peer, Server, float], None]]] = {
    "it starts": ("started", _started),
    "the call is on its way": ("sent", _sent),
    "it waits for its server": ("fibonacci", _waits),
    "the server has not accepted yet": ("slow_accept", _asked),
    "the goal runs": ("runs", _runs),
    "the goal is being cancelled": ("slow_cancel", _cancels),
}


def _hang_up(peer: Peer) -> None:
    peer.hang_up()


def _twice(peer: Peer) -> None:
    peer.serving.signal(signal.SIGTERM)
    peer.serving.signal(signal.SIGTERM)


ENDS: dict[str, Callable[[Peer], None]] = {
    "the host closes standard input": _hang_up,
    "SIGTERM twice": _twice,
    "SIGINT and end of input": lambda peer: (peer.serving.signal(signal.SIGINT), peer.hang_up())[0],
    "SIGKILL": lambda peer: peer.serving.signal(signal.SIGKILL),
}


def _ends(place: Place, toolbox: Toolbox, phase: str, end: str, loop: Any) -> str:
    name, arrive = PHASES[phase]
    server, since = place.server(name), time.monotonic()
    with Peer(place) if arrive is not _started else _Early(place) as peer:
        arrive(peer, server, since)
        ENDS[end](peer)
        within = 30.0 if arrive is _started else 5.0  # it imports first
        if not peer.serving.is_gone(within):
            return f"it does not end within {within:g} s"
        if end != "SIGKILL":
            left = asyncio.run(left_running(server, since, 8.0))
            said = peer.errors.read_text()
            unnamed = [goal for goal in left if goal not in said]
            return f"nobody names {unnamed}: {said[-300:]}" if unnamed else ""
    # Its goals are left: other processes name them.
    domain = ("--domain-id", str(place.robot.domain))
    words = [sys.executable, "-m", "actionkit", "cancel", f"/{server.action_name}", "--all"]
    for goal in received(server, since):
        until(
            lambda one=goal: (
                ended(server, one)
                or one
                in str(asyncio.run_coroutine_threadsafe(toolbox.call("goals"), loop).result(30))
            ),
            f"the tool `goals` names {goal}",
        )
        subprocess.run([*words, *domain], check=False, capture_output=True)
    return ""


class _Early(Peer):
    """Does not wait for the process to answer."""

    def __enter__(self) -> _Early:
        for method, params in (
            ("initialize", self.hello()),
            ("tools/call", {"name": "started", "arguments": {}}),
        ):
            self.begin(method, params)
        return self


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
    time.sleep(0.3)  # a goal would be sent by then
    if got := orders(place.server("fibonacci"), since):
        return f"goals {got} were sent"
    return "".join(map(unclean, peer.messages))


# -- a toolbox ---------------------------------------------------------------------------------

Attack = Callable[[Place, Toolbox], Awaitable[str]]
PATROL = "never_finishes"


async def _hold_races(place: Place, toolbox: Toolbox) -> str:
    """Hold the robot and send a goal at the same moment, again and again."""
    server, chance, began = place.server(PATROL), random.Random(7), time.monotonic()
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
    server, chance, since = place.server(PATROL), random.Random(8), time.monotonic()
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

    server, since = place.server(PATROL), time.monotonic()
    names = ("patrol", "patrol2", "ask_patrol") * 10
    calls = [asyncio.ensure_future(toolbox.call(name, approve=yes)) for name in names]
    await asyncio.wait(calls, timeout=20.0, return_when=asyncio.FIRST_EXCEPTION)
    refused = sum(one.done() and one.result().value["status"] == "refused" for one in calls)
    got = received(server, since)
    await toolbox.cancel_all()
    await asyncio.wait(calls)
    left = await left_running(server, since)
    right = (len(got), refused, server.max_running) == (1, 29, 1) and not left
    return (
        ""
        if right
        else f"{got} sent, {refused} refused, {server.max_running} at a time, left: {left}"
    )


OTHER = """
import rclpy, sys
from rclpy.action import ActionClient
from test_msgs.action import Fibonacci
rclpy.init(args=["--ros-args", *sys.argv[1:]])
node = rclpy.create_node("other")
client = ActionClient(node, Fibonacci, "other")
client.wait_for_server()
goal = client.send_goal_async(Fibonacci.Goal())
rclpy.spin_until_future_complete(node, goal)
print("sent", flush=True)
sys.stdin.readline()
rclpy.spin_until_future_complete(node, goal.result().cancel_goal_async())
"""


def _of_another(*remapped: str) -> Attack:
    async def run(place: Place, toolbox: Toolbox) -> str:
        server, since = place.server(PATROL), time.monotonic()
        env = os.environ | {"ROS_DOMAIN_ID": str(place.robot.domain)}
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
        names = ("send_goal", "cancel_goal", "get_result", "feedback", "status")
        rules = [f"other/_action/{name}:=/{PATROL}/_action/{name}" for name in names]
        words = [*remapped, *(word for rule in rules for word in ("-r", rule))]
        other = subprocess.Popen(  # noqa: ASYNC220  takes a moment
            [sys.executable, "-c", OTHER, *words], env=env, text=True, **pipes
        )
        try:
            await asyncio.to_thread(until, server.running)
            value = dict((await toolbox.call("patrol")).value)
            told = str((await toolbox.call("goals")).value)
            got = received(server, since)
        finally:
            with suppress(subprocess.TimeoutExpired):
                await asyncio.to_thread(other.communicate, "\n", 10.0)
            other.kill()
        await left_running(server, since)
        if len(got) != 1 or value["error"]["type"] != "too_many_goals":
            return f"{got} sent: {value}"
        return "" if got[0] in told else f"not named: {told[:300]}"

    return run


def _gives_up(tool: str, action: str, how: str) -> Attack:
    """Give up a call that has not been accepted yet, or waits for its server."""

    async def run(place: Place, toolbox: Toolbox) -> str:
        server, since = place.server(action), time.monotonic()
        calling = asyncio.ensure_future(toolbox.call(tool, {"order": 5}))
        if tool == "late":
            await asyncio.to_thread(until, lambda: received(server, since))
        else:
            await asyncio.to_thread(until, toolbox.goals)
        if how == "hold":
            await asyncio.to_thread(place.stop)
        elif how == "cancel":
            calling.cancel()
        else:
            await toolbox.cancel_all()
        await asyncio.wait([calling], timeout=10.0)
        if not calling.done():
            return "the call does not end"
        await asyncio.to_thread(place.free)
        if not calling.cancelled() and calling.result().value["status"] == "succeeded":
            goals = received(server, since)
            if not all(ended(server, goal) for goal in goals):
                return "a wrong outcome"
        left = await left_running(server, since)
        named = str((await toolbox.call("goals")).value)
        return "".join(f"nobody names {goal}" for goal in left if goal not in named)

    return run


async def _held_at_first(place: Place, toolbox: Toolbox) -> str:
    """Call in the moment in which a toolbox begins to listen."""
    since = time.monotonic()
    await asyncio.to_thread(place.stop)
    async with Toolbox.from_config(place.config) as young:
        values = await asyncio.gather(*(young.call("patrol") for _ in range(5)))
    await asyncio.to_thread(place.free)
    got = received(place.server(PATROL), since)
    wrong = [one.value for one in values if one.value["status"] != "refused"]
    return f"{got} sent: {wrong}" if got or wrong else ""


async def _flickers(place: Place, toolbox: Toolbox) -> str:
    """Hold and release again and again, while calls come."""
    server, since, wrong = place.server(PATROL), time.monotonic(), ""
    for _ in range(10):
        calling = asyncio.ensure_future(toolbox.call("patrol"))
        for _ in range(3):
            await asyncio.to_thread(place.stop)
            await asyncio.to_thread(place.free)
        await asyncio.to_thread(place.stop)
        value = dict((await asyncio.wait_for(calling, 20.0)).value)
        wrong = wrong or ("" if value["status"] in ("refused", "canceled") else str(value))
        await asyncio.to_thread(place.free)
    left = await left_running(server, since)
    return wrong or (f"left: {left}" if left else "")


async def _closed(place: Place, toolbox: Toolbox) -> str:
    """Close a toolbox in each moment of a call."""
    server, since = place.server(PATROL), time.monotonic()
    for delay in (0.0, 0.05, 0.1, 0.2, 0.3):
        young = Toolbox.from_config(place.config)
        await young.__aenter__()
        await young.call("count", {"order": 0})  # it knows by then whether the robot is held
        calling = asyncio.ensure_future(young.call("patrol"))
        await asyncio.sleep(delay)
        await asyncio.wait_for(young.aclose(), 15.0)
        value = dict((await asyncio.wait_for(calling, 5.0)).value)
        again = dict((await young.call("patrol")).value)
        if value["status"] not in ("refused", "canceled") or again["error"]["type"] != "closed":
            return f"{value}, then {again}"
    left = await left_running(server, since)
    return f"left: {left}" if left else ""


# What a server does; what may be told of it then.
OUTCOMES: dict[str, tuple[str, dict[str, Any], tuple[str, ...]]] = {
    "succeeds": ("fibonacci", {}, ("succeeded",)),
    "aborts": ("aborts", {}, ("aborted",)),
    "raises": ("raises", {}, ("aborted",)),
    "rejects": ("scripted", {"script": ["reject"]}, ("rejected",)),
    "ends as cancelled, unasked": ("cancels_itself", {}, ("canceled",)),
    "never answers": ("silent", {}, ("no_answer", "timed_out")),
    "sends no result": ("no_result", {}, ("result_lost", "succeeded", "timed_out")),
    "forgets results": ("expires", {}, ("result_lost", "succeeded")),
    "is killed": ("crashes", {"point": "feedback"}, ("lost", "timed_out")),
    "is killed before it accepts": ("crashes", {"point": "before_accept"}, ("lost", "timed_out")),
    "goes away": ("vanishes", {}, ("lost", "timed_out")),
    "refuses to cancel": ("refuses_cancel", {"period": 3.0}, ("timed_out",)),
    "ignores a cancel": ("ignores_cancel", {"period": 3.0}, ("timed_out",)),
    "has another type": ("wrong_type", {}, ("failed", "no_server")),
}


async def _outcome(place: Place, toolbox: Toolbox, name: str) -> str:
    kind, options, allowed = OUTCOMES[name]
    server = place.server(kind, f"outcome_{_key(name)}", **options)
    since = time.monotonic()
    value = dict((await asyncio.wait_for(toolbox.call(_key(name), {"order": 5}), 40.0)).value)
    left = [] if not server.alive else await left_running(server, since, 0.5)
    if value["status"] not in allowed:
        return f"told {value}"
    if left and not value["may_still_run"] and kind != "vanishes":
        return f"{left} runs, and that is not told: {value}"
    return unclean(value)


def _key(name: str) -> str:
    return "".join(one if one.isalpha() else "_" for one in name)


TOOLBOX: dict[str, Attack] = {
    f"a hold and a goal at the same moment, {ROUNDS} times": _hold_races,
    "cancelling at any moment, 30 times": _cancel_races,
    "thirty calls of three tools at once, one may run": _all_at_once,
    "a goal of another program, remapped": _of_another(),
    "a goal of another program in a namespace, remapped": _of_another("-r", "__ns:=/x"),
    **{
        f"{what}: {how}": _gives_up(tool, action, how)
        for what, tool, action in (
            ("not accepted yet", "late", "slow_accept"),
            ("waits for its server", "absent", "fibonacci"),
        )
        for how in ("hold", "cancel", "cancel_all")
    },
    "five calls of a toolbox that starts under a hold": _held_at_first,
    "a hold that comes and goes": _flickers,
    "a toolbox that is closed at any moment": _closed,
}


async def attacks(place: Place) -> AsyncIterator[tuple[str, str]]:
    """Yield the name of each attack, and what is wrong, `""` where it failed."""
    loop = asyncio.get_running_loop()
    for name, options in (
        ("fibonacci", {"period": 0.02}),
        (PATROL, {}),
        ("slow_accept", {"delay": 1.0, "period": 0.3}),
        ("slow_cancel", {}),
    ):
        place.server(name, **options)
    one: dict[str, Any] = {"type": "test_msgs/action/Fibonacci", "expose": "all", "retries": 0}
    for name in ("started", "sent", "runs"):
        place.server(PATROL, name)
        place.add({name: {**one, "action": f"/{name}", "timeout": 60.0}})
    place.add(
        {
            _key(name): {**one, "action": f"/outcome_{_key(name)}", "timeout": 5.0}
            for name in OUTCOMES
        }
    )
    async with Toolbox.from_config(place.config) as toolbox:
        with Peer(place) as peer:
            for name, line in LINES.items():
                yield f"stdio: {name}", await tried(_line, place, peer, line)
        for name, attack in TOOLBOX.items():
            yield f"Toolbox: {name}", await tried(attack, place, toolbox)
        turns = asyncio.Semaphore(3)

        async def phase(name: str) -> list[tuple[str, str]]:
            async with turns:
                words = (place, toolbox, name)
                return [(f"{name}: {end}", await tried(_ends, *words, end, loop)) for end in ENDS]

        for found in await asyncio.gather(*map(phase, PHASES)):
            for told in found:
                yield told
        outcomes = (tried(_outcome, place, toolbox, name) for name in OUTCOMES)
        for name, wrong in zip(OUTCOMES, await asyncio.gather(*outcomes), strict=True):
            yield f"a server that {name}", wrong
        late = await asyncio.to_thread(place.server, "fibonacci", "absent")
        await asyncio.sleep(1.0)
        late.sync()
        yield "a server that comes when all have given up", str(late.running() or "")

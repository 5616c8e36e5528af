"""One call of an action's tool: checks, approval, checks again, the goal, its end."""

from __future__ import annotations

import asyncio
import json
import logging
from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Any

from actionkit._internal_api import in_thread, prepare_call, status_topic, unless_by_anyio
from actionkit._messages.convert import from_plain, to_plain
from actionkit._messages.json_text import to_json
from actionkit._model.field_errors import FieldProblem
from actionkit._model.printable import visible
from actionkit.agents._answers.plain import plain_json
from actionkit.agents._answers.progress import telling
from actionkit.agents._answers.results import refusal, tool_result
from actionkit.agents._configuration.config import ActionConfig
from actionkit.agents._tool_calls.clients import Clients
from actionkit.agents._tool_calls.goals import Goals, ToolGoal
from actionkit.agents._tool_calls.hold import HoldListener
from actionkit.agents._values import ApprovalRequest, Approve, OnProgress, ToolResult

if TYPE_CHECKING:
    from actionkit._ros.others_goals.goal_board import WatchedGoal

_log = logging.getLogger("actionkit")
_UNTIL_KNOWN = 13.0
"""Seconds to wait until it is known whether a human has stopped the robot. It takes four; ten where
another agent on the computer was killed shortly before, and is still in sight."""
_NOT_SENT_AGAIN = (
    "the goal failed, and was not sent again: it was not known any more that no human has stopped"
    " the robot"
)
_CANCEL_GRACE = 1.0
"""Seconds on top of `timeouts.cancel`, which bounds the confirmation by itself."""
_LONGEST_QUESTION = 4000
"""Characters; what is longer cannot be read through by anybody."""
_SHORTEST_QUESTION = 100
_CHANGE = "Change the arguments as the tool's schema says; nothing was sent."


class GoalCalls:
    """Calls the tools of actions.

    Attributes:
        stops: How many times all was cancelled: what waited to be sent then is not sent.
    """

    def __init__(self, clients: Clients, goals: Goals) -> None:
        self._clients = clients
        self._goals = goals
        self.stops = 0
        # `actionkit stop` cannot cancel a goal that no server knows yet; this can.
        clients.on_hold = self.cancel_all

    def cancel_all(self, why: str) -> list[ToolGoal]:
        """Cancel what is in flight, and what waits to be sent; never blocks, from any thread."""
        self.stops += 1  # first: a call that is not in the list yet looks at this
        records = self._goals.counting()
        for record in records:
            record.cancel(why)
        return records

    async def call(
        self,
        tool: ActionConfig,
        arguments: Mapping[str, Any],
        on_progress: OnProgress | None,
        approve: Approve | None,
    ) -> ToolResult:
        """Call a tool; see `Toolbox.call`."""
        stops = self.stops
        try:
            goal = _goal(tool, arguments)
            await self._ready(tool)
            if tool.confirm == "always":
                await self._room(tool)  # else a human would be asked for nothing
                with telling(on_progress, lambda: "waiting for a human to approve this"):
                    await _ask(tool, goal, approve)
            hold = await self._ready(tool)
            client, others = await self._room(tool)  # after that: it may have waited long
            if not hold.is_known:  # during the look, another agent came into sight, or died
                hold = await self._ready(tool)
                client, others = await self._room(tool)
            return await self._send(tool, goal, client, hold, stops, others, on_progress)
        except _Refused as refused:
            return refused.result

    async def start(self) -> HoldListener:
        """Begin to listen for a human's stop.

        Raises:
            ImportError: rclpy is not there.
            RuntimeError: The toolbox was closed.
        """
        return await in_thread(self._clients.hold)

    async def _of_others(self, client: Any) -> list[WatchedGoal]:
        """Return the goals of other programs that the servers of a client have now."""

        def look(domain_id: int | None, stopped: Callable[[], bool]) -> list[WatchedGoal]:
            from actionkit._ros.others_goals.watch import goals_in_flight

            return goals_in_flight(domain_id, status_topic(client), stopped)

        return self._goals.of_others(await self._clients.read(look))

    async def _room(self, tool: ActionConfig) -> tuple[Any, list[WatchedGoal]]:
        """Return the client, and the goals of other programs, unless there are too many.

        Only the client knows the full name of the action: ROS arguments of the process, such as a
        namespace, change it.
        """
        others: list[WatchedGoal] = []
        try:
            client = await in_thread(lambda: self._clients.client(tool))
            running = self._goals.counting(client.action_name)
            if len(running) < tool.concurrent:
                others = await self._of_others(client)
        except Exception as error:
            raise self._failed(tool, error) from error
        if len(running) + len(others) >= tool.concurrent:
            raise _too_many(tool, running, others)
        return client, others

    async def others(self, tools: Iterable[ActionConfig]) -> list[tuple[ActionConfig, WatchedGoal]]:
        """Return the goals of other programs on the actions of tools, where that is known."""
        if self._clients.closed or self._clients.listening is None:
            return []
        found: dict[str, tuple[ActionConfig, WatchedGoal]] = {}
        for told in await asyncio.gather(*(self._others_on(tool) for tool in tools)):
            for tool, goal in told:
                found.setdefault(goal.goal_id, (tool, goal))
        return list(found.values())

    async def _others_on(self, tool: ActionConfig) -> list[tuple[ActionConfig, WatchedGoal]]:
        try:
            client = await in_thread(lambda: self._clients.client(tool))
            return [(tool, goal) for goal in await self._of_others(client)]
        except Exception as error:  # noqa: BLE001  also what the middleware raises
            _log.warning("the goals of %s are not known: %s", tool.action, error)
            return []

    async def _ready(self, tool: ActionConfig) -> HoldListener:
        """Return the listener for a human's stop; refuse if no goal may be sent now."""
        try:
            hold = self._clients.listening or await self.start()
        except Exception as error:
            raise self._failed(tool, error) from error
        if not hold.is_known:
            await hold.until_known(_UNTIL_KNOWN)
        self._check(tool, hold)
        return hold

    async def _send(
        self,
        tool: ActionConfig,
        goal: Any,
        client: Any,
        hold: HoldListener,
        stops: int,
        others: list[WatchedGoal],
        on_progress: OnProgress | None,
    ) -> ToolResult:
        """Send the goal and wait for its end. Before `record.follow`, nothing is awaited."""
        record = ToolGoal(tool.name, client.action_name)
        # Counted before the last check: a stop that comes after the check finds and cancels it.
        if not self._goals.add(record, tool.concurrent - len(others)):
            raise _too_many(tool, self._goals.counting(record.action), others)
        sent = False

        def before_resend() -> None:
            if not hold.surely_free:
                record.cancel(_NOT_SENT_AGAIN)

        try:
            self._check(tool, hold)
            if self.stops != stops:
                text = "everything was cancelled while this waited to be sent"
                raise _Refused(tool, "cancelled", text, "Ask before going on.")
            with telling(on_progress, lambda: record.state) as on_feedback:
                future, begin = prepare_call(
                    client,
                    goal,
                    tool.timeout,
                    on_feedback=on_feedback,
                    before_resend=before_resend,
                )
                record.follow(future)  # first: an interruption cannot lose the goal
                begin()
                sent = True
                await record.over()
        except _Refused:
            raise
        except BaseException as error:
            if not sent and isinstance(error, Exception):
                raise self._failed(tool, error) from error
            record.cancel("its caller gave up")
            if sent and isinstance(error, asyncio.CancelledError):
                with unless_by_anyio():
                    await record.over(client.timeouts.cancel + _CANCEL_GRACE)
            raise
        finally:
            if not sent:
                self._goals.remove(record)
        assert record.value is not None
        return tool_result(record.value)

    def _check(self, tool: ActionConfig, hold: HoldListener) -> None:
        """Refuse if the toolbox was closed, or a human has stopped the robot."""
        if self._clients.closed:
            raise _closed(tool)
        if (why := hold.why_held()) is None:
            return
        if hold.is_known:
            advice = "Send nothing until a human has released the robot; ask them."
            raise _Refused(tool, "held", why, advice)
        raise _Refused(tool, "hold_unknown", why, "Try again in a few seconds.", retry=True)

    def _failed(self, tool: ActionConfig, error: Exception) -> _Refused:
        if self._clients.closed:
            return _closed(tool)
        _log.warning("%s: nothing was sent: %s", tool.name, error, exc_info=error)
        text = f"the toolbox cannot send goals to the action {tool.action}; its log says why"
        advice = "Nothing was sent; ask a human to look at the toolbox."
        return _Refused(tool, "failed", text, advice)


class _Refused(Exception):
    """The call is refused, and nothing was sent."""

    def __init__(
        self, tool: ActionConfig, kind: str, text: str, advice: str, *, retry: bool = False
    ) -> None:
        super().__init__(text)
        self.result = refusal(tool.name, kind, text, retry=retry, advice=advice)


def _goal(tool: ActionConfig, arguments: Mapping[str, Any]) -> Any:
    """Return the goal message."""
    fields, problems = tool.fields.check(arguments)
    if not problems:
        try:
            return from_plain(tool.cls.Goal, fields)
        except FieldProblem as problem:
            problems = [str(problem)]
    raise _Refused(tool, "invalid_arguments", "; ".join(problems), _CHANGE)


async def _ask(tool: ActionConfig, goal: Any, approve: Approve | None) -> None:
    """Have a human approve the goal."""
    if approve is None:
        text = f"{tool.name} needs a human's approval, and nobody can be asked"
        advice = "Do without it, or use a program that can ask a human."
        raise _Refused(tool, "nobody_to_ask", text, advice)
    whole = json.loads(to_json(to_plain(goal)))
    question = f"May {tool.name} send this goal to the action {tool.action}?\n{question_of(goal)}"
    if await _answer(approve, ApprovalRequest(tool.name, whole, question)) is not True:
        text = "a human was asked, and did not approve"
        advice = "Do not ask for the same again; ask the human what to do instead."
        raise _Refused(tool, "not_approved", text, advice)


def question_of(goal: Any) -> str:
    """Return a goal as text for a human: every field, but long values are cut."""
    # Without what a human cannot see, or what a terminal takes for commands.
    whole = json.loads(to_json(to_plain(goal)))
    shown = visible(json.dumps(whole, indent=2, ensure_ascii=False))
    most = _LONGEST_QUESTION
    while len(shown) > _LONGEST_QUESTION and most > _SHORTEST_QUESTION:
        most //= 2  # long texts and arrays are cut first, and say how much is missing
        plain = plain_json(goal, most_characters=most, escape=False)  # it is below
        shown = visible(json.dumps(plain, indent=2, ensure_ascii=False))
    if len(shown) > _LONGEST_QUESTION:
        cut = len(shown) - _LONGEST_QUESTION
        shown = f"{shown[:_LONGEST_QUESTION]}\n… {cut} more characters, not shown"
    return shown


async def _answer(approve: Approve, request: ApprovalRequest) -> object:
    """Return what a human says; being cancelled counts, even if `approve` swallows it.

    Awaited as it is, it could swallow the cancellation (as `asyncio.wait_for` may before Python
    3.12), and the goal of a caller that has given up would be sent.
    """
    asking = asyncio.ensure_future(approve(request))
    try:
        await asyncio.wait([asking])
    except asyncio.CancelledError:
        asking.cancel()
        raise
    return asking.result()


def _too_many(tool: ActionConfig, running: list[ToolGoal], others: list[WatchedGoal]) -> _Refused:
    ids = [record.report()["goal_id"] or "one that waits to be sent" for record in running]
    ids += [f"{goal.goal_id} (of another program)" for goal in others]
    text = f"{tool.name} allows {tool.concurrent} at a time, and as many run or may run"
    advice = "Wait until they have ended; the tool `goals` tells when."
    if others:
        advice += " A goal of another program can also be stopped by a human, or by that program."
    return _Refused(tool, "too_many_goals", f"{text}: {', '.join(ids[:5])}", advice, retry=True)


def _closed(tool: ActionConfig) -> _Refused:
    advice = "Nothing can be done with it any more."
    return _Refused(tool, "closed", "the toolbox was closed", advice)

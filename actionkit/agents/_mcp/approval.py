"""A human's approval before a goal, asked for through the client, in both eras of the protocol.

Until 2025-11-25 the server sends the client a request, and waits. Since 2026-07-28 it answers the
call with a question, and the client calls again with what the human said; what makes the two
belong together is sealed by the SDK, and good for one goal (C10.3).
"""

from __future__ import annotations

import asyncio
import secrets
import time
from collections.abc import Callable, Mapping
from typing import Any

import mcp.types as t
from mcp.server import ServerRequestContext
from mcp.shared.exceptions import MCPError
from pydantic import ValidationError

from actionkit.agents._values import ApprovalRequest

PATIENCE = 600.0
"""Seconds in which a human has to answer."""
_FIELD = "approve"
_SCHEMA: dict[str, Any] = {
    "type": "object",
    "properties": {_FIELD: {"type": "boolean", "title": "Let the robot do this"}},
    "required": [_FIELD],
}
_MALFORMED = "the client's answer to the question cannot be understood, so nobody has approved"
_MOST_OPEN = 1000
MODERN = "2026"
"""Versions of the protocol from here on let servers send no requests."""


class CannotAskError(Exception):
    """No human could be asked, or none answered."""


def can_ask(ctx: ServerRequestContext[Any, Any]) -> bool:
    """Return whether the client has said that it can show a form to its user."""
    capabilities = ctx.session.client_capabilities
    elicitation = None if capabilities is None else capabilities.elicitation
    if elicitation is None:
        return False
    # Where it names no kind at all it means forms: there was no other at first.
    return elicitation.form is not None or elicitation.url is None


def _agreed(action: str, content: Mapping[str, Any] | None) -> bool:
    return action == "accept" and (content or {}).get(_FIELD) is True


class Asked:
    """Asks by a request to the client, and waits for its answer."""

    def __init__(self, ctx: ServerRequestContext[Any, Any]) -> None:
        self._ctx = ctx

    async def __call__(self, request: ApprovalRequest) -> bool:
        """Return whether the human agrees.

        Raises:
            CannotAskError: The client could not ask, or nobody answered.
        """
        asking = asyncio.ensure_future(
            self._ctx.session.elicit_form(request.text, _SCHEMA, self._ctx.request_id)
        )
        try:
            # No `asyncio.wait_for`: before Python 3.12 it may swallow the cancellation of the
            # task, and the goal of a client that has given up would be sent.
            await asyncio.wait([asking], timeout=PATIENCE)
        finally:
            answered = not asking.cancel()
        if not answered:
            raise CannotAskError(f"nobody answered within {PATIENCE:g} seconds")
        try:
            answer = asking.result()
        except MCPError as error:
            raise CannotAskError(f"the client could not ask ({error})") from error
        except ValidationError as error:
            raise CannotAskError(_MALFORMED) from error
        return _agreed(answer.action, answer.content)


class Questions:
    """The questions that clients have taken home, each good for one goal.

    After a human's stop they are good for none: the human is asked again.
    """

    def __init__(self, stops: Callable[[], int]) -> None:
        """Take what returns how many times all goals were cancelled."""
        self._stops = stops
        self._open: dict[str, tuple[float, int]] = {}
        """Until when each is good, and after how many stops it was asked."""

    def ask(self) -> str:
        """Return the mark of a new question."""
        now = time.monotonic()
        self._open = {mark: one for mark, one in self._open.items() if one[0] > now}
        while len(self._open) >= _MOST_OPEN:
            del self._open[next(iter(self._open))]
        mark = secrets.token_urlsafe(16)
        self._open[mark] = now + PATIENCE, self._stops()
        return mark

    def answered(self, mark: str | None) -> bool:
        """Return whether a question is open; it is not any more."""
        until, stops = self._open.pop(mark or "", (0.0, -1))
        return until > time.monotonic() and stops == self._stops()


class Returned:
    """Asks by what the call returns; the call that comes after has the answer.

    Attributes:
        question: What is to be returned, where the human has not been asked yet.
    """

    def __init__(self, params: t.CallToolRequestParams, questions: Questions) -> None:
        self._params = params
        self._questions = questions
        self.question: t.InputRequiredResult | None = None

    async def __call__(self, request: ApprovalRequest) -> bool:
        """Return whether the human agreed; where nobody has asked yet, put `question`."""
        # The boundary has made sure that the state is ours, fresh, and for these arguments.
        answer = (self._params.input_responses or {}).get(_FIELD)
        if self._questions.answered(self._params.request_state) and isinstance(
            answer, t.ElicitResult
        ):
            return _agreed(answer.action, answer.content)
        ask = t.ElicitRequestFormParams(message=request.text, requested_schema=_SCHEMA)
        self.question = t.InputRequiredResult(
            input_requests={_FIELD: t.ElicitRequest(params=ask)},
            request_state=self._questions.ask(),
        )
        return False

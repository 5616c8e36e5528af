"""Finds the goals in a recording: what happened to each, as lines of a log."""

from __future__ import annotations

import math
import re
import uuid
from collections.abc import Iterator
from dataclasses import dataclass, field
from struct import Struct
from struct import error as StructError
from typing import Any

from actionkit._messages.json_text import to_json
from actionkit._model.values import GoalEvent, GoalState
from actionkit._observers.json_schema import LoggedLine, event_data
from actionkit._observers.protocol import CallInfo
from actionkit._recordings.bag_fields import Fields
from actionkit._recordings.bag_files import Bag, Message
from actionkit._ros.answers.wire import ID_SIZE, STATES, feedback_goal_id, goals
from actionkit._ros.others_goals.server_numbers import GoalKey, ServerNumbers

_TOPIC = re.compile(
    r"(.+)/_action/(status|feedback|(?:send_goal|get_result|cancel_goal)/_service_event)"
)
_TYPE = re.compile(r"(.+)_(?:FeedbackMessage|SendGoal_Event|GetResult_Event)")
_INFO = Struct("<4xB3xiI16s4xqI")
"""CDR: the header, `service_msgs/ServiceEventInfo`, and how many requests follow: 0 or 1."""
_COUNT = Struct("<I")
_HEADER = 4
_STAMP = Struct("<II")
_GOAL_INFO = Struct("<16sII")
_ANSWERED = 2
"""The kind of service event by which a server tells of its answer."""
_TERMINATED = 3
"""The answer to a cancel request: the goal had ended (`action_msgs/srv/CancelGoal`)."""
_LONGEST = 100
"""Characters of fields in the text of an event; the event's data have all of them."""
_MOST_FEEDBACK = 300
"""Messages of feedback that are kept of each goal: more would not fit beside each other."""
_ONE_CLOCK = 86400.0
"""Seconds. An acceptance longer ago was stamped by another clock, such as a simulation's."""
_LATE = 1.0
"""Seconds that a message may need to a recorder. If it seems to need more, the clocks differ."""


@dataclass
class _Event:
    """One event of a goal. The goal's lines are made of them at the end."""

    state: GoalState | None  # `None` if it changes no state
    at: float  # seconds since the epoch
    detail: str = ""
    refused: bool = False  # as `GoalEvent.cancel_refused`
    fields: dict[str, Any] = field(default_factory=dict)  # further fields of the line


@dataclass
class _Goal:
    """One goal on one server."""

    goal_id: bytes
    server: int = 0  # its number; 0 until it is known
    stamp: tuple[int, ...] = ()  # of its acceptance, by its server
    state: GoalState | None = None
    since: float = -math.inf  # when it came into this state
    events: list[_Event] = field(default_factory=list)
    feedback: list[tuple[int, float, bytes]] = field(default_factory=list)
    """The feedback that is kept: its number, when it came, and the message."""
    step: int = 1  # one of so many is kept

    @property
    def ended(self) -> bool:
        return self.state is not None and self.state.is_terminal

    def add(self, state: GoalState, at: float, detail: str = "") -> None:
        """Add an event with a state that the goal is in from now on."""
        self.state = state
        self.since = at = max(at, self.since)  # clocks differ, and topics are not in step
        self.events.append(_Event(state, at, detail))

    def sent(self, at: float, detail: str, **fields: Any) -> None:
        """Add the event that comes before all others."""
        self.state = self.state or GoalState.SENT
        at = min([at, *(event.at for event in self.events)])
        self.events.append(_Event(GoalState.SENT, at, detail, fields=fields))

    def note(self, at: float, detail: str, *, refused: bool = False) -> None:
        """Add an event that changes no state."""
        self.events.append(_Event(None, at, detail, refused))

    def add_feedback(self, at: float, data: bytes) -> None:
        """Keep the first and the last feedback, and so many between that a picture has them all."""
        kept = self.feedback
        number = kept[-1][0] + 1 if kept else 1
        if kept and (number - 2) % self.step:
            kept.pop()
        kept.append((number, at, data))
        if len(kept) > _MOST_FEEDBACK:
            self.step *= 2
            last = kept[-1]
            self.feedback = [each for each in kept if each is last or not (each[0] - 1) % self.step]

    def another_has_it(self) -> None:
        """Note that the server that rejected it was not the only one."""
        self.state, self.since = GoalState.SENT, -math.inf
        for event in self.events:
            if event.state is GoalState.REJECTED:
                event.state, event.detail = None, "one of the servers rejected it"


@dataclass
class _Request:
    """A request to a service of the action. Its client and the servers may each tell of it."""

    goal_id: bytes
    to_cancel: list[_Goal]  # the goals that it asks to cancel
    answered: bool = False
    told: set[tuple[int, str]] = field(default_factory=set)  # what is noted, by goal


class _Action:
    """Collects the goals of one action."""

    def __init__(self, fields: Fields) -> None:
        self.goals: dict[bytes, list[_Goal]] = {}
        """The goals by id, each with one entry for each server that has it."""
        self.servers = ServerNumbers()
        self.type = ""
        self._fields = fields
        self._codes: dict[int, dict[GoalKey, int]] = {}  # in the latest status of each server
        self._began = math.inf  # when the first status was recorded
        self._requests: dict[tuple[bytes, int, str], _Request] = {}
        """By the request's client, number and service."""

    def take(self, kind: str, message: Message) -> None:
        """Take a message of one of the action's topics."""
        if found := _TYPE.fullmatch(message.ros_type):
            self.type = found[1]
        at = message.stamp * 1e-9
        if kind == "status":
            self._status(at, message.data)
        elif kind == "feedback":
            self._goal(feedback_goal_id(message.data)).add_feedback(at, message.data)
        else:
            self._service(kind.partition("/")[0], at, message.data)

    def _goal(self, goal_id: bytes, server: int = 0) -> _Goal:
        """Return a goal; `server` is the number of its server, or 0 if that is not known."""
        if len(goal_id) != ID_SIZE:
            raise IndexError("the message is cut off")
        found = self.goals.setdefault(goal_id, [])
        own = [goal for goal in found if server in (0, goal.server) or not goal.server]
        if not own:
            own = [_Goal(goal_id, server)]
            for event in found[0].events if found else ():
                if event.state is GoalState.SENT:  # each server got the request
                    own[0].sent(event.at, event.detail, **event.fields)
            found += own
        goal = next((goal for goal in own if not goal.ended), own[0])
        goal.server = goal.server or server
        return goal

    # --- the status topic ----------------------------------------------------------------------

    def _status(self, at: float, data: bytes) -> None:
        codes = {goal[:3]: goal[3] for goal in goals(data)}
        if len(codes) < _COUNT.unpack_from(data, _HEADER)[0]:
            raise IndexError("the message is cut off")
        self._began = min(self._began, at)
        if not codes:
            return
        server = self.servers.of(codes)
        before, self._codes[server] = self._codes.get(server, {}), codes
        for (goal_id, *stamp), code in sorted(codes.items() - before.items()):
            if code in STATES:
                goal = self._goal(goal_id, server)
                goal.stamp = tuple(stamp)
                self._changed(goal, STATES[code], at, stamp[0] + stamp[1] * 1e-9)

    def _changed(self, goal: _Goal, state: GoalState, at: float, accepted: float) -> None:
        """Note a state; `accepted` is the server's stamp of the goal's acceptance."""
        if goal.state is GoalState.REJECTED:
            goal.another_has_it()
        if goal.ended or goal.state is state:  # messages may cross
            return
        if goal.state in (None, GoalState.SENT):
            if state.is_terminal and goal.state is None and accepted < self._began:
                goal.add(state, at, "it had ended when the recording began")
                return
            if 0 <= at - accepted < _ONE_CLOCK:
                goal.add(GoalState.ACCEPTED, accepted)
        if goal.state is not state:
            goal.add(state, at)

    # --- service events ------------------------------------------------------------------------

    def _service(self, service: str, at: float, data: bytes) -> None:
        kind, seconds, nanoseconds, client, number, requests = _INFO.unpack_from(data)
        happened = seconds + nanoseconds * 1e-9
        if 0 <= at - happened < _LATE:  # not when it came: other topics may be faster
            at = happened
        key, place = (client, number, service), _INFO.size
        request = self._requests.get(key)
        if requests and request is None:
            goal_id = bytes(data[place : place + ID_SIZE])
            self._requests[key] = request = _Request(goal_id, [])
            if service == "send_goal":
                fields = self._fields.goal(self.type, data)
                self._goal(goal_id)
                for goal in self.goals[goal_id]:
                    goal.sent(at, _text(fields), goal=fields, sent_by=sender(client))
            elif service == "cancel_goal":
                request.to_cancel = self._to_cancel(goal_id, _STAMP.unpack_from(data, place + 16))
                for goal in request.to_cancel:
                    goal.note(at, f"{sender(client)} asks to cancel it")
        elif not requests and request and _COUNT.unpack_from(data, place)[0]:
            # Each server tells of its answer, and the client of the first that came.
            if kind == _ANSWERED or not request.answered:
                self._answer(service, at, data, place + _COUNT.size, request)
            request.answered = True

    def _to_cancel(self, goal_id: bytes, stamp: tuple[int, ...]) -> list[_Goal]:
        """Return the goals that a request to cancel is about (`action_msgs/srv/CancelGoal`)."""
        if any(goal_id):
            self._goal(goal_id)  # it may be older than the recording
        return [
            goal
            for goal in (goal for found in self.goals.values() for goal in found)
            if goal.goal_id == goal_id
            or (not goal.ended and not any(goal_id) and not any(stamp))
            or (not goal.ended and any(stamp) and goal.stamp and goal.stamp <= stamp)
        ]

    def _answer(self, service: str, at: float, data: bytes, place: int, request: _Request) -> None:
        if service == "send_goal":
            goal = self._goal(request.goal_id)
            if goal.state is GoalState.REJECTED and data[place]:
                goal.another_has_it()
            if goal.state is GoalState.SENT:
                goal.add(GoalState.ACCEPTED if data[place] else GoalState.REJECTED, at)
        elif service == "get_result":
            state = STATES.get(data[place])
            if state is not None and state.is_terminal:
                self._ended(request.goal_id, state, at, self._fields.result(self.type, data))
        else:
            self._cancelled(at, data, place, request)

    def _ended(self, goal_id: bytes, state: GoalState, at: float, fields: Any) -> None:
        found = self.goals.get(goal_id) or [self._goal(goal_id)]
        same = [goal for goal in found if goal.state is state]
        if not same and len(found) == 1 and not found[0].ended:
            found[0].add(state, at)
            same = found
        # Of several servers, it is not known which one answers.
        for event in same[0].events if same else ():
            if event.state is state:
                event.detail, event.fields = _text(fields) or event.detail, {"result": fields}

    def _cancelled(self, at: float, data: bytes, place: int, request: _Request) -> None:
        (count,) = _COUNT.unpack_from(data, place + 4)  # after the code
        listed = data[place + 4 + _COUNT.size :][: count * _GOAL_INFO.size]
        if len(listed) < count * _GOAL_INFO.size:
            raise IndexError("the message is cut off")
        agreed = {each[0]: each[1:] for each in _GOAL_INFO.iter_unpack(listed)}
        others = [self._goal(goal_id) for goal_id in agreed]
        for goal in (*request.to_cancel, *others):
            stamp, refused = agreed.get(goal.goal_id), False
            if stamp is not None and goal.stamp not in ((), stamp):
                continue  # another server answers
            if stamp is not None:
                said = "the server agrees to cancel it"
            elif data[place] == _TERMINATED or goal.ended:
                said = "the server answers that it had ended"
            else:
                said, refused = "the server refuses to cancel it", True
            if (id(goal), said) in request.told:
                continue
            request.told.add((id(goal), said))
            if stamp is not None and not goal.ended and goal.state is not GoalState.CANCELING:
                goal.add(GoalState.CANCELING, at, said)
            else:
                goal.note(at, said, refused=refused)


def sender(client: bytes) -> str:
    """Return who has this id, which is that of a client.

    Fast DDS puts an id of the process into the first 12 bytes. CycloneDDS has only 8 bytes, which
    are other ones for each service of a client.
    """
    return f"program {client[:12].hex()}" if any(client[12:]) else f"client {client[:8].hex()}"


def _text(fields: dict[str, Any] | None) -> str:
    if fields is None:
        return ""
    text = to_json(fields)
    return text if len(text) <= _LONGEST else text[: _LONGEST - 1] + "…"


def is_of_action(topic: str) -> bool:
    """Return whether a topic is one of those of an action."""
    return bool(_TOPIC.fullmatch(topic))


def goals_in(bag: Bag) -> list[list[LoggedLine]]:
    """Return the lines of each goal in a recording, in the order in which the goals began."""
    fields = Fields(bag.definitions)
    actions: dict[str, _Action] = {}
    cut_off: set[str] = set()
    for message in bag.messages():
        found = _TOPIC.fullmatch(message.topic)
        try:
            if found:
                actions.setdefault(found[1], _Action(fields)).take(found[2], message)
        except (StructError, IndexError):
            cut_off.add(message.topic)
    lines = [each for name, action in actions.items() for each in _lines(name, action, fields)]
    if cut_off:
        bag.problems.append(f"Messages of {', '.join(sorted(cut_off))} are cut off: not read.")
    if fields.missing:
        types = ", ".join(sorted(fields.missing))
        bag.problems.append(
            f"The fields of {types} are not shown: the types are not recorded, or cannot be"
            " decoded."
        )
    bag.problems += not_recorded(bag.topics)
    return sorted(lines, key=lambda goal: float(goal[0].data["wall"]))


def _lines(name: str, action: _Action, fields: Fields) -> Iterator[list[LoggedLine]]:
    for goal in (goal for found in action.goals.values() for goal in found):
        for number, at, message in goal.feedback:
            more = {"feedback": fields.feedback(action.type, message)}
            goal.events.append(_Event(GoalState.FEEDBACK, at, f"#{number}", fields=more))
        if not goal.events:
            continue
        events = sorted(goal.events, key=lambda event: event.at)
        goal_id = uuid.UUID(bytes=goal.goal_id)
        call_id = goal_id if goal.server < 2 else uuid.uuid5(goal_id, str(goal.server))
        call = CallInfo(call_id, name, action.type, "", events[0].at, events[0].at)
        server = {"server": goal.server} if len(action.servers) > 1 else {}
        lines, current = [], GoalState.SENT
        for each in events:
            state = each.state or current
            current = current if state is GoalState.FEEDBACK else state
            event = GoalEvent(goal_id, 1, state, each.at, each.at, each.detail, each.refused)
            data = event_data(event, call, 0, **each.fields, **server)
            lines.append(LoggedLine("event", call_id, name, action.type, "", 0, event, data))
        yield lines


def not_recorded(topics: dict[str, str]) -> list[str]:
    """Return what to record the next time, for actions that lack a topic."""
    found = [each for topic in topics if (each := _TOPIC.fullmatch(topic))]
    names = sorted({each[1] for each in found})
    if not names:
        return [
            "No topics of actions are recorded. They are hidden topics; this records them, too:"
            " ros2 bag record -a --include-hidden-topics"
        ]
    wanted = [f"{name}/_action/{kind}" for name in names for kind in ("status", "feedback")]
    notes = []
    if missing := [topic for topic in wanted if topic not in topics]:
        notes.append(
            f"Not recorded: {', '.join(missing)}. This records them:"
            f" ros2 bag record --include-hidden-topics --topics {' '.join(missing)}"
        )
    told = {each[1] for each in found if each[2] == "send_goal/_service_event"}
    if silent := [name for name in names if name not in told]:
        notes.append(
            f"Not recorded: who sent the goals of {', '.join(silent)}, and what they were. Since"
            " Kilted, servers publish this if their introspection is on, and this records it:"
            f" ros2 bag record --actions {' '.join(silent)}"
        )
    return notes

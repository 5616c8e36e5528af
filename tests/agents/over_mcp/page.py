"""The tables of docs/maintainers/agents-faults.md: the required rows, and how tests record them."""

from __future__ import annotations

from tests.agents.over_mcp.lab import WAYS
from tests.tables import Page

GIVEN_UP = "The agent gives up"
OUTCOME = "The goal does not come out"
REFUSED = "What is refused"
ASKED = "A human is asked first"
HELD = "A human stops the robot"
ENDED = "The process is told to end"
HTTP_ONLY = "Over HTTP only"

EVERY = tuple(str(way) for way in WAYS)
HTTP = EVERY[2:]
ANY_HTTP = ("HTTP",)
ANY_STDIO = ("stdio",)

FAULTS: dict[str, dict[str, tuple[str, ...]]] = {
    GIVEN_UP: {
        "the request is cancelled": EVERY,
        "the client's read timeout": EVERY,
        "the client closes the connection": EVERY,
        "the client is killed (SIGKILL)": EVERY,
        "the host reads nothing, and closes standard input": ANY_STDIO,
        "the host is killed, and a child of it keeps standard input open": ANY_STDIO,
    },
    OUTCOME: {
        "the server aborts the goal": EVERY,
        "the server rejects the goal": EVERY,
        "the tool's time runs out": EVERY,
        "no server is there": EVERY,
        "the server is killed (SIGKILL)": ANY_HTTP,
        "the request is cancelled, and the server refuses to cancel": ANY_HTTP,
    },
    REFUSED: {
        "a field outside of its limits": EVERY,
        "a field of another type": EVERY,
        "a field that is not there": EVERY,
        "a third goal, where two at a time are allowed": EVERY,
        "an unknown tool": EVERY,
        "arguments nested 10,000 deep": ("stdio", "HTTP"),
        "a message of 5 MB": ("stdio", "HTTP"),
    },
    ASKED: {
        "they agree": EVERY,
        "they decline": EVERY,
        "they dismiss the question": EVERY,
        "they accept, without the tick": EVERY,
        "the client cannot ask": EVERY,
        "the client gives up while the human thinks": EVERY,
        "the arguments are outside of their limits": EVERY,
        "the client sends the same approval again": (EVERY[1], EVERY[3]),
        "the client changes the arguments after the approval": (EVERY[1], EVERY[3]),
        "the client approves without having been asked": (EVERY[1], EVERY[3]),
    },
    HELD: {
        "`actionkit stop` while a goal runs": EVERY,
        "the next call, under the hold": EVERY,
        "a call of an agent that starts under the hold": EVERY,
        "a call after `actionkit stop --release`": EVERY,
    },
    ENDED: {
        "SIGTERM": ("stdio", "HTTP"),
        "SIGINT": ("stdio",),
        "SIGHUP": ("stdio",),
        "SIGTERM, and the host reads nothing": ANY_STDIO,
        "SIGTERM, and the event loop hangs": ANY_STDIO,
        "SIGTERM, and the action server does not answer (SIGSTOP)": ANY_STDIO,
        "standard input is closed, and the action server does not answer": ANY_STDIO,
        "SIGKILL": ANY_HTTP,
        "SIGKILL of all its processes, and a call of the next start": ANY_HTTP,
    },
    HTTP_ONLY: {
        "the client is gone before its call begins": HTTP,
        "the client ends its session (DELETE)": HTTP[:1],
        "the client hangs (SIGSTOP)": HTTP,
        "the network between client and server is cut": HTTP,
        "no token, or a wrong one": ANY_HTTP,
        "another `Host` (DNS rebinding)": ANY_HTTP,
        "another `Origin` (a web page)": ANY_HTTP,
    },
}


PAGE = Page(
    "maintainers/agents-faults.md",
    {
        group: [(fault, over) for fault, ways in faults.items() for over in ways]
        for group, faults in FAULTS.items()
    },
)


def record(
    group: str, fault: str, over: object, reached: str, told: str, process: str = "serves on"
) -> None:
    """Compare a row with the page.

    Args:
        group: The table.
        fault: What was done.
        over: How the agent talks to the robot.
        reached: What reached the action server.
        told: What the agent was told.
        process: What happened to the process that serves.
    """
    PAGE.record(group, {(fault, str(over)): (reached, told, process)})

"""What docs/agents-faults.md says around its tables, and which rows there have to be."""

from __future__ import annotations

from tests.agents.over_mcp.lab import WAYS
from tests.agents.over_mcp.table import PATH, Case, Row, render

GIVEN_UP = "The agent gives up"
OUTCOME = "The goal does not come out"
REFUSED = "What is refused"
ASKED = "A human is asked first"
HELD = "A human stops the robot"
ENDED = "The process is told to end"
HTTP_ONLY = "Over HTTP only"

INTRO = """
# Agents' faults, and what comes of them

This page is written by the tests in `tests/agents/over_mcp/`, which do what it tells of with real
action servers, real processes and the clients of the MCP Python SDK, over both transports and in
both eras of the protocol, and fail where it is no longer so
(`ACTIONKIT_WRITE_AGENTS=1 pytest -n 0 tests/agents/over_mcp` writes it anew). How to set it up is
told in [An MCP server for the robot](mcp.md).

- **over**: the transport and the version of the protocol.
- **what reached the action server**: all goals that it was sent, and how each ended there.
- **what the agent was told**: the `status` of the tool's result, and whether trying again makes
  sense. A call that was cancelled is never answered, by the protocol; after "then" is what the
  tool `goals` said of it.
- **`actionkit mcp`**: what became of the process. Times are bounds that no run may exceed.
"""

GROUPS = {
    GIVEN_UP: """
While a goal runs, the agent cancels its request, stops waiting, leaves, or is no more. In every way
the action server is told to cancel.""",
    OUTCOME: """
The tool's result says what happened, in a form that a program can read.""",
    REFUSED: """
Nothing of this is sent, whatever the model or the client thinks of the tool's schema.""",
    ASKED: """
The tool has `confirm = "always"`: the client shows a question to its user (elicitation).""",
    HELD: """
With `actionkit stop`, in any terminal of the ROS domain.""",
    ENDED: """
While a goal runs. Hosts close standard input, send SIGTERM after 2 seconds, and SIGKILL after 2
more.""",
    HTTP_ONLY: """
Who may come in, and connections that are dead.""",
}

EVERY = tuple(str(way) for way in WAYS)
STDIO = EVERY[:2]
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
    },
    HTTP_ONLY: {
        "the client is gone before its call begins": HTTP,
        "the client ends its session (DELETE)": HTTP[:1],
        "the network between client and server is cut": HTTP,
        "no token, or a wrong one": ANY_HTTP,
        "another `Host` (DNS rebinding)": ANY_HTTP,
        "another `Origin` (a web page)": ANY_HTTP,
    },
}


def cases() -> list[Case]:
    """All rows that there have to be, in order."""
    return [
        Case(group, fault, over)
        for group, faults in FAULTS.items()
        for fault, ways in faults.items()
        for over in ways
    ]


def write(rows: list[Row]) -> str:
    """Write the page where every row is there; return what became of it."""
    by_case = {row.case: row for row in rows}
    missing = [case for case in cases() if case not in by_case]
    if missing:
        return f"not written; {len(missing)} rows are missing, such as {missing[0]}"
    PATH.write_text(render(INTRO, GROUPS, [by_case[case] for case in cases()]), "utf-8")
    return f"written, {len(by_case)} rows"

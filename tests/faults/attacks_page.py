"""What docs/attacks.md says around its tables."""

from __future__ import annotations

from tests.faults.attacks import DEAF, GIVEN_UP, JUDGES, LOSS, RACE, SOAK

INTRO = """
# Attacks, and what comes of them

[Faults](faults.md) tells what becomes of single goals when a server or the network fails. This
page is about numbers: it is written by the tests in `tests/faults/`, which try to make ActionKit
break its two first promises, that no goal is left running that its caller has given up on, and
that no outcome is untrue. They fail where it is no longer so
(`ACTIONKIT_WRITE_ATTACKS=1 pytest -n 0 tests/faults -k attack` writes the page anew). The servers
are real rclpy servers in processes of their own, and what is counted is what their own journals
say.

- **tried**: so many goals or calls.
- **left running**: goals that ran on though their caller had given up on them, and of which the
  program did not say that they may. Always 0.
- **wrong outcomes**: calls whose outcome is not what the server's journal shows. Always 0.
- **longest delay**: the slowest of them; of what, each section says. No run may take longer.
"""

#: What is done, by section, in the order of the page.
EXPLAINED = {
    GIVEN_UP: """
A program has so many goals running on one server, and gives up on all of them at once. Each has to
be cancelled on the server, and (but for the deadlines) each call has to know so: an outcome that
is not `CONFIRMED` counts as wrong. A server has room for ten requests, and drops what comes
beyond that. The delay is from the moment of giving up to the end of the last goal on the server or
of the program, whichever is later. Where deadlines pass it is from the deadline to the last
error; the goals have to end within ten seconds.""",
    DEAF: """
The server is stopped (SIGSTOP), so that nothing can be cancelled. The program must come to an end
all the same, and say on standard error (or, where it closes the client, in its log) how many goals
may still run, and which. The delay is from giving up to the end of the program.""",
    RACE: """
Goals last about as long as their deadlines: some end before, some after, most at the same time.
An outcome is wrong where it calls a goal refused or cancelled that succeeded, or keeps back the
result of one that did so within `Timeouts.cancel`. The delay is from the deadline to the
error.""",
    LOSS: """
Two hosts; each drops so many of the packets that come in, at random. Ten calls are made at a time,
with 100 s for each; a plain rclpy client in the same network sends as many goals, ten at a time.
A call that fails counts as wrong where the plain client lost fewer. The delay is how long the
slowest call took: DDS asks for what was lost every 3 s.""",
    JUDGES: """
Callbacks of the user's, or log handlers, block for good. Other calls end successfully on the
server; `classify=` would judge each result a failure. An outcome that is a success is wrong. The
delay is from the deadline of 3 s to the end of the call.""",
    SOAK: """
`python -m tests.soak --minutes 60` does all of this and more in turn and at the same time, with
threads, asyncio, retries, judges, servers that are killed, stopped and restarted, lossy networks
and programs that are told to end; and compares each call's outcome with the journals. The
delay is the longest beyond a call's bound.""",
}

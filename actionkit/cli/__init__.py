"""The command line `actionkit`. Imports heavy modules only when they are needed."""

from __future__ import annotations

import contextlib
import signal
import sys
from collections.abc import Sequence
from typing import NoReturn

from actionkit.cli._shared import early


def main(arguments: Sequence[str] | None = None) -> NoReturn:
    """Run the command `actionkit` and end the process with its exit code.

    `arguments` are the words after `actionkit`; `None` takes them from `sys.argv`.
    """
    try:
        with early.remembered():
            from actionkit.cli._app import run
        code = int(run(arguments))
        if sys.stdout is not None:  # `mcp >&-`
            sys.stdout.flush()
    except KeyboardInterrupt:
        # The call is cleaned up by now; nothing may interrupt the rest.
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        early.be_quiet()
        code = 130  # Exit.INTERRUPTED; the signal may have interrupted its import
        with contextlib.suppress(OSError):  # the reader was interrupted, too
            print("\nInterrupted.", file=sys.stderr)
    except OSError:
        # The program that reads our output (`| head`) ended, or the output cannot be written.
        # Python flushes again at exit.
        from actionkit.cli._shared.signals import discard_output

        discard_output()
        code = 141  # Exit.OUTPUT_CLOSED
    sys.exit(code)

"""The command line (contract C6.3). Nothing heavy is imported before it is needed."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Sequence
from typing import NoReturn


def main(arguments: Sequence[str] | None = None) -> NoReturn:
    """Run the command `actionkit` and end the process with its exit code.

    Args:
        arguments: The words after `actionkit`; `None` takes them from `sys.argv`.
    """
    try:
        from actionkit.cli._app import run

        code = int(run(arguments))
        sys.stdout.flush()
    except KeyboardInterrupt:
        # What was in use has been cleaned up on the way here; nothing may interrupt the rest.
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        print("\nInterrupted.", file=sys.stderr)
        code = 130  # Exit.INTERRUPTED, whose import may be what was interrupted
    except BrokenPipeError:
        # Whoever read our output (`| head`) went away, and Python flushes it once more at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        code = 1  # Exit.FAILED; as click does where it notices first
    sys.exit(code)

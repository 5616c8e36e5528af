"""The command line. Nothing heavy is imported before it is needed."""

from __future__ import annotations

import contextlib
import signal
import sys
import warnings
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
        # The call has been cleaned up on the way here; nothing may interrupt the rest.
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        # What was half-made at that moment, such as an event loop, may complain when it is freed.
        sys.unraisablehook = lambda _: None
        warnings.simplefilter("ignore")
        code = 130  # Exit.INTERRUPTED; its import may be what was interrupted
        with contextlib.suppress(OSError):  # its reader was interrupted as well
            print("\nInterrupted.", file=sys.stderr)
    except BrokenPipeError:
        # The reader of our output (`| head`) went away, and Python flushes it once more at exit.
        from actionkit.cli._signals import discard_output

        discard_output()
        code = 141  # Exit.OUTPUT_CLOSED
    sys.exit(code)

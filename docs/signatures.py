"""For mkdocs.yml: leaves parameters that take nothing (`*misplaced: Never`) out of the reference.

They are there to explain a wrong call, and a reader has no use for them.
"""

from __future__ import annotations

from typing import Any

import griffe


class HideRefusedParameters(griffe.Extension):
    """Removes each parameter that is annotated with `Never`."""

    def on_function(self, *, func: griffe.Function, **_: Any) -> None:
        """Remove those of one function."""
        kept = [each for each in func.parameters if str(each.annotation) != "Never"]
        # What came behind `*misplaced` can still be given by name alone.
        func.parameters = griffe.Parameters(*kept)

"""What a built package says of itself, in a file beside its libraries."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path

FILE = "actionkit_build.json"


@dataclass(frozen=True)
class BuildRecord:
    """How a package was built.

    Attributes:
        name: The package.
        version: From its package.xml.
        key: The fingerprint of all that it was made from.
        uses: The packages whose types it uses, and those that these use.
        share: Its folder of .idl and .msg files, relative to the package's folder.
        libraries: Its libraries with their sizes in bytes.
    """

    name: str
    version: str
    key: str
    uses: list[str]
    share: str
    libraries: dict[str, int]

    def write(self, folder: Path) -> None:
        (folder / FILE).write_text(json.dumps(asdict(self), indent=1) + "\n", "utf-8")

    def is_complete(self, folder: Path) -> bool:
        """Return whether everything that was built is still there."""
        return (folder / self.share / "package.xml").is_file() and all(
            path.is_file() and path.stat().st_size == size
            for path, size in ((folder / name, size) for name, size in self.libraries.items())
        )


def read_record(folder: Path) -> BuildRecord | None:
    """Return what a package says of itself; `None` if it was not built by us."""
    try:
        return BuildRecord(**json.loads((folder / FILE).read_text("utf-8")))
    except (OSError, ValueError, TypeError):
        return None

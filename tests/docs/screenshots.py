"""Takes a screenshot of each kind of page of the site, for a human to look at.

`python -m tests.docs.screenshots FOLDER` builds the site and writes PNGs into the folder. It needs
the extra `docs`, and Chromium or Chrome on the PATH.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread

from tests.docs.snippets import ROOT

PAGES = {
    "home": "index.html",
    "sidebar": "sidebar.html",
    "search": "index.html?q=cancel a goal",
    "tutorial": "tutorial/",
    "guide": "guides/nav2/",
    "reference": "reference/client/",
    "commands": "reference/commands/",
    "tables": "cost/",
    "glossary": "glossary/",
}
WIDTHS = {"desktop": 1280, "phone": 420}
HEIGHT = 1600
"""Pixels from the top of each page; more than a screen has, so that more is seen."""


SCRIPTS = 4.0
"""Seconds in which the scripts of a page have run; the search reads its index in that time."""


class _Handler(SimpleHTTPRequestHandler):
    def do_GET(self) -> None:
        """Answer as a site does, but hold up one picture, for which Chromium waits."""
        if self.path == "/slow.png":
            time.sleep(SCRIPTS)
        super().do_GET()

    def log_message(self, format: str, *args: object) -> None:
        """Say nothing of each request."""


@contextmanager
def _served(folder: str) -> Iterator[str]:
    """Serve a folder on this machine; opened as files, the pages have no search."""
    handler = partial(_Handler, directory=folder)
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()


def main(folder: Path) -> None:
    """Build the site, and write `PAGE-WIDTH.png` for each."""
    found = (shutil.which(name) for name in ("chromium", "chromium-browser", "google-chrome"))
    browser = next(filter(None, found), None)
    if browser is None:
        sys.exit("there is no Chromium on the PATH")
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as site:
        build = [sys.executable, "-m", "mkdocs", "build", "--quiet", "-d", site]
        subprocess.run(build, cwd=ROOT, env=os.environ | {"NO_MKDOCS_2_WARNING": "1"}, check=True)
        # What a phone shows after a tap on its menu.
        home, menu = (Path(site) / "index.html").read_text("utf-8"), 'id="__drawer"'
        (Path(site) / "sidebar.html").write_text(home.replace(menu, f"{menu} checked"), "utf-8")
        with _served(site) as address:
            for page, place in PAGES.items():
                for kind, width in WIDTHS.items():
                    # In a frame: a window of Chromium cannot be as narrow as a phone.
                    (Path(site) / "frame.html").write_text(
                        f'<body style="margin:0"><iframe src="{place}" style="border:0" '
                        f'width="{width}" height="{HEIGHT}"></iframe><img src="slow.png" hidden>'
                    )
                    target = folder.resolve() / f"{page}-{kind}.png"
                    words = [
                        "--headless",
                        "--no-sandbox",  # which containers do not allow; the pages are our own
                        "--hide-scrollbars",
                        f"--window-size={width},{HEIGHT}",
                        f"--screenshot={target}",
                        f"{address}/frame.html",
                    ]
                    subprocess.run([browser, *words], stderr=subprocess.DEVNULL, check=True)
                    print(target)


if __name__ == "__main__":
    main(Path(sys.argv[1]))

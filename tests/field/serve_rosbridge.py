"""Runs rosbridge, and a web page that serves an action.

    python serve_rosbridge.py FOLDERS ROSBRIDGE PAGE

FOLDERS are for `sys.path`, ROSBRIDGE is the folder with its sources, PAGE a program that stands
for a page in a browser. rosbridge listens on a free port, for this computer alone. Lines on
standard input are commands: `kill page` ends the page as a crash of the browser does, `start page`
opens it again; the two together are a reload. At their end, rosbridge ends.
"""

from __future__ import annotations

import os
import runpy
import subprocess
import sys
import threading
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import IO, Any

_PAGE = """
import sys
from pathlib import Path
address, page, *sys.path[:0] = sys.argv[1:]
source = Path(page).read_text("utf-8")
assert "127.0.0.1:9090" in source
exec(compile(source.replace("127.0.0.1:9090", address), page, "exec"))
"""
"""Opens the page, which connects to this address."""


class Page:
    """The page, in a process of its own."""

    def __init__(self, program: str, folders: list[str], port: int) -> None:
        self._command = [sys.executable, "-c", _PAGE, f"127.0.0.1:{port}", program, *folders]
        self._process = self._started()

    def obey(self, commands: IO[str], end: Callable[[], object]) -> None:
        """Do what the lines say."""
        for line in commands:
            if line == "kill page\n":
                self._process.kill()
                self._process.wait()
            elif line == "start page\n":
                self._process = self._started()
        end()

    def _started(self) -> subprocess.Popen[bytes]:
        # With it, Python writes the end of a line by itself, and rosbridge may write in between.
        environment = {key: text for key, text in os.environ.items() if key != "PYTHONUNBUFFERED"}
        return subprocess.Popen(self._command, stdin=subprocess.DEVNULL, env=environment)


def main() -> None:
    """Serve until the input ends, or a signal ends the program."""
    paths, rosbridge, program = sys.argv[1:]
    folders = paths.split(os.pathsep)
    sources = [Path(rosbridge, f"rosbridge_{name}", "src") for name in ("library", "server")]
    sys.path[:0] = [*folders, *map(str, sources)]
    import rclpy
    from rclpy.signals import SignalHandlerOptions
    from tornado import netutil
    from tornado.ioloop import IOLoop

    bind_sockets, loop = netutil.bind_sockets, IOLoop.current()
    stop = partial(loop.add_callback, loop.stop)

    def bind_and_open(*_: object) -> Any:
        sockets = bind_sockets(0, "127.0.0.1")
        page = Page(program, folders, sockets[0].getsockname()[1])
        threading.Thread(target=page.obey, args=(sys.stdin, stop), daemon=True).start()
        return sockets

    netutil.bind_sockets = bind_and_open
    # With rclpy's handler, a signal does not end rosbridge: its loop may go on without a context.
    rclpy.init = partial(rclpy.init, signal_handler_options=SignalHandlerOptions.NO)
    script = Path(rosbridge, "rosbridge_server", "scripts", "rosbridge_websocket.py")
    sys.argv[:] = [str(script)]
    runpy.run_path(str(script), run_name="__main__")


if __name__ == "__main__":
    main()

"""Starts Python programs for tests as forks of a process that has imported what they need.

A fresh interpreter that imports rclpy and ActionKit takes half a second of CPU, a fork 10 ms. The
process that forks has made no thread and no node, so a program that begins in it finds what it
would find in an interpreter of its own. Not for tests of what an interpreter does when it starts.
"""

from __future__ import annotations

import atexit
import ctypes
import gc
import importlib
import io
import json
import os
import runpy
import socket
import subprocess
import sys
import threading
import types
import warnings
from contextlib import redirect_stderr, redirect_stdout, suppress
from pathlib import Path
from typing import Any

from execnet.gateway_io import popen_bootstrapline

_PRELOADED = (
    "asyncio",
    "multiprocessing.util",
    "actionkit.cli._app",
    "actionkit.servers._serving.child",
    "actionkit.servers._serving.harness",
    "actionkit.testing",
    "rclpy.action",
    "rclpy.executors",
    "test_msgs.action",
    "tests.forked",
)
_AGENTS = ("actionkit.agents._mcp.process", "mcp", "uvicorn")
_MORE = {
    "plain": (),
    "agents": _AGENTS,
    # pytest-xdist's processes, with the tests. Not for others: what is imported costs at the end of
    # a program, too.
    "tests": (*_AGENTS, "hypothesis.strategies", "py_trees", "pytest", "trio"),
}
"""What is imported for each kind of programs, too."""
collected: list[str] = []
"""Where pytest-xdist's processes look for tests, as pytest's arguments say it."""
_PROGRAM = "from tests.forked import main; main()"
_LONGEST = 1 << 20
_SUBREAPER = 36  # PR_SET_CHILD_SUBREAPER


# -- in the process of the tests -------------------------------------------------------------


class _Forker:
    """A process that forks, and the way to it. One for each kind and each process of tests."""

    def __init__(self, kind: str) -> None:
        self._libc = ctypes.CDLL(None, use_errno=True)
        self._socket, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, "-c", _PROGRAM, str(theirs.fileno()), kind, *collected],
                pass_fds=[theirs.fileno()],
                cwd=Path(__file__).parents[1],
                # One of numpy's threads could not be forked.
                env=_environment | {"OPENBLAS_NUM_THREADS": "1"},
                # Ctrl-C in the terminal is for the tests.
                start_new_session=True,
            )

    def fork(self, request: dict[str, Any], descriptors: list[int]) -> tuple[int, str]:
        """Start a program; return the id of its process, a child of this one, and a problem."""
        # Its parent has ended when the id comes, and then it belongs to the nearest ancestor that
        # asks for such. Not always: other tests look for what their programs leave behind.
        self._libc.prctl(_SUBREAPER, 1, 0, 0, 0)
        try:
            message = json.dumps(request).encode()
            socket.send_fds(self._socket, [message], descriptors)
            pid, _, problem = self._socket.recv(_LONGEST).decode().partition(" ")
        finally:
            self._libc.prctl(_SUBREAPER, 0, 0, 0, 0)
        if not pid:
            raise RuntimeError("the process that forks has ended")
        return int(pid), problem

    def end(self) -> None:
        self._socket.close()
        self._process.wait()


_forkers: dict[str, _Forker] = {}
_lock = threading.Lock()
"""One for all kinds: who gets the children of a parent that ended is said for a whole process."""


def _fork(request: dict[str, Any], descriptors: list[int]) -> int:
    kind = request["kind"]
    with _lock:
        if kind not in _forkers:
            _forkers[kind] = _Forker(kind)
        try:
            pid, problem = _forkers[kind].fork(request, descriptors)
        except BaseException:  # also Ctrl-C: the next answer would be that to this request
            _forkers.pop(kind).end()
            raise
    if problem:
        os.waitpid(pid, 0)
        raise OSError(problem)
    return pid


@atexit.register
def close() -> None:
    """End the processes that fork."""
    with _lock:
        while _forkers:
            _forkers.popitem()[1].end()


class Popen(subprocess.Popen[Any]):
    """`subprocess.Popen` for `[sys.executable, ...]`, as a fork.

    What a fork cannot be starts as a fresh interpreter: another program, one that asks what has
    been imported, or other options of the interpreter than `-W` and `-u`.
    """

    # What `subprocess` calls when the pipes are made. Python 3.11 has one argument more.
    def _execute_child(  # type: ignore[override]
        self, args: Any, executable: Any, preexec_fn: Any, close_fds: bool, pass_fds: Any,
        cwd: Any, env: Any, startupinfo: Any, creationflags: Any, shell: bool,
        p2cread: int, p2cwrite: int, c2pread: int, c2pwrite: int, errread: int, errwrite: int,
        restore_signals: bool, gid: Any, gids: Any, uid: Any, umask: int,
        start_new_session: bool, *more: Any,
    ) -> None:  # fmt: skip
        plain = not (preexec_fn or pass_fds or shell or executable or uid or gid or gids)
        plain &= restore_signals and umask == -1 and all(one in (-1, None) for one in more)
        words = [os.fspath(word) for word in args] if not isinstance(args, str) else []
        environment = dict(os.environ if env is None else env)
        if not environment.keys() & set(_LIBRARIES):
            environment |= {name: os.environ[name] for name in _LIBRARIES if name in os.environ}
        program = _program(words) if plain and close_fds and _can_be(environment) else None
        if program is None:
            super()._execute_child(  # type: ignore[misc]
                args, executable, preexec_fn, close_fds, pass_fds, cwd, env, startupinfo,
                creationflags, shell, p2cread, p2cwrite, c2pread, c2pwrite, errread, errwrite,
                restore_signals, gid, gids, uid, umask, start_new_session, *more,
            )  # fmt: skip
            return
        request = {
            **program,
            "command": words,
            "environment": environment,
            "folder": os.fspath(cwd) if cwd is not None else os.getcwd(),
            "new_session": start_new_session,
        }
        mine = [p2cread, c2pwrite, errwrite]
        given = [own if own != -1 else standard for standard, own in enumerate(mine)]
        try:
            self.pid = _fork(request, given)
            self._child_created = True
        finally:
            for descriptor, other in zip(mine, (p2cwrite, c2pread, errread), strict=True):
                if descriptor != -1 and other != -1:
                    os.close(descriptor)
            devnull = getattr(self, "_devnull", None)
            if devnull is not None:
                os.close(devnull)
            self._closed_child_pipe_fds = True


SUBPROCESS = types.SimpleNamespace(**{**vars(subprocess), "Popen": Popen})
"""The module `subprocess` for code that is to use forks."""


def run(command: list[str], **options: Any) -> subprocess.CompletedProcess[Any]:
    """Do what `subprocess.run` does with `Popen`; `capture_output` and `input` included."""
    text, timeout = options.pop("input", None), options.pop("timeout", None)
    check = options.pop("check", False)
    if options.pop("capture_output", False):
        options |= {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    if text is not None:
        options["stdin"] = subprocess.PIPE
    with Popen(command, **options) as process:
        try:
            out, err = process.communicate(text, timeout)
        except BaseException:
            process.kill()
            raise
    if check and process.returncode:
        raise subprocess.CalledProcessError(process.returncode, command, out, err)
    return subprocess.CompletedProcess(command, process.returncode, out, err)


_LIBRARIES = ("LD_LIBRARY_PATH", "_ROS_WHEELS_BOOTSTRAP_COMPLETE")
"""What the wheels of ROS set for an interpreter, which starts itself again then."""
_MATTER = ("PYTHON", "LD_", "RMW_")
"""How variables begin that count when an interpreter starts, or when it loads what is loaded."""
_UNDERSTOOD = {"PYTHONUNBUFFERED", "PYTHONWARNINGS"}


def _can_be(environment: dict[str, str]) -> bool:
    """Whether an interpreter would have the same libraries and network as the one that forks."""
    names = {name for name in {*environment, *_environment} if name.startswith(_MATTER)}
    different = {n for n in names if environment.get(n, "") != _environment.get(n, "")}
    return different <= _UNDERSTOOD and _namespaces() == _own_namespaces


def _namespaces() -> list[str]:
    return [os.readlink(f"/proc/thread-self/ns/{name}") for name in ("net", "mnt")]


# Now, before a test changes them.
_environment = dict(os.environ)
_own_namespaces = _namespaces()


def _program(words: list[str]) -> dict[str, Any] | None:
    """Read the interpreter's command line; `None` if only an interpreter can do what it says."""
    if not words or words[0] != sys.executable:
        return None
    warn, unbuffered, rest = [], False, words[1:]
    while rest and rest[0] in ("-W", "-u"):
        if rest[0] == "-u":
            unbuffered, rest = True, rest[1:]
        else:
            warn, rest = [*warn, rest[1]], rest[2:]
    if rest[:1] in (["-c"], ["-m"]):
        how, what, arguments = rest[0], rest[1], rest[2:]
        if "sys.modules" in what:  # where there is much already
            return None
    elif rest and not rest[0].startswith("-"):
        how, what, arguments = "file", rest[0], rest[1:]
    else:
        return None
    kind = "agents" if "mcp" in arguments or "actionkit.agents" in what else "plain"
    if what == popen_bootstrapline:
        kind = "tests"
    return {
        "how": how,
        "what": what,
        "arguments": arguments,
        "warn": warn,
        "unbuffered": unbuffered,
        "kind": kind,
    }


# -- in the process that forks ---------------------------------------------------------------


def main() -> None:
    """Fork for each request. Returns in the forks alone, when their program has ended."""
    descriptor, kind, *places = sys.argv[1:]
    warnings.filterwarnings("error", module=r"actionkit\b")
    for name in _PRELOADED:
        importlib.import_module(name)
    for name in _MORE[kind]:
        with suppress(ImportError):  # of extras
            importlib.import_module(name)
    if kind == "tests":
        _import_tests(places)
    _load_libraries()
    gc.collect()
    gc.freeze()
    with socket.socket(fileno=int(descriptor)) as requests:
        while True:
            message, descriptors, _, _ = socket.recv_fds(requests, _LONGEST, 3)
            if not message:  # the tests have ended
                os._exit(0)
            request = json.loads(message)
            answer = _fork_twice(request, descriptors)
            if answer is None:
                break
            for each in descriptors:
                os.close(each)
            requests.send(answer)
    _run(request)


def _import_tests(places: list[str]) -> None:
    """Have pytest import the tests, with its changes to their `assert`, as it does in each process.

    Afterwards it finds them imported, and only makes its items.
    """
    import pytest

    # The plugin for reruns makes a thread. pytest-xdist would make processes.
    options = ["-o", "addopts=-p no:asyncio -p no:rerunfailures -p no:xdist", "--collect-only"]
    with open(os.devnull, "w") as nowhere, redirect_stdout(nowhere), redirect_stderr(nowhere):
        pytest.main([*options, "-qq", *places])  # errors are told by the processes


def _load_libraries() -> None:
    """Load those of the middleware and of the type that nearly all programs use."""
    import rclpy
    from rclpy.type_support import check_for_type_support
    from test_msgs.action import Fibonacci

    rclpy.get_rmw_implementation_identifier()
    check_for_type_support(Fibonacci)


def _fork_twice(request: dict[str, Any], descriptors: list[int]) -> bytes | None:
    """Return the grandchild's id and what went wrong in it; in the grandchild return `None`.

    When this returns, the grandchild's parent has ended, and the grandchild is what an interpreter
    would be when it begins with the program.
    """
    sys.stdout.flush()
    told, tells = os.pipe()
    waits, ended = os.pipe()
    if (child := os.fork()) == 0:
        if (grandchild := os.fork()) == 0:
            os.close(told)
            os.close(ended)
            os.read(waits, 1)  # until the parent has ended, and this is a child of the tests
            os.close(waits)
            try:
                _begin(request, descriptors)
            except BaseException as error:  # noqa: BLE001  it is told
                os.write(tells, f" {error!r}".encode())
                os._exit(1)
            os.close(tells)
            return None
        os.write(tells, str(grandchild).encode())
        os._exit(0)
    os.close(tells)
    os.close(waits)
    os.waitpid(child, 0)
    os.close(ended)
    with open(told, "rb") as file:
        return file.read()


def _begin(request: dict[str, Any], descriptors: list[int]) -> None:
    """Make of the fork what an interpreter with these words would be."""
    # rclpy's library for traces has made a thread, which is not here, and its end would crash.
    libc = ctypes.CDLL(None)
    libc.on_exit(libc._exit, None)
    if request["new_session"]:
        os.setsid()
    kept = [os.dup(descriptor) for descriptor in descriptors]
    for standard, descriptor in enumerate(kept):
        os.dup2(descriptor, standard)
    for descriptor in (*kept, *descriptors):
        if descriptor > 2:
            os.close(descriptor)
    os.chdir(request["folder"])
    os.environ.clear()
    os.environ.update(request["environment"])
    unbuffered = request["unbuffered"] or bool(os.environ.get("PYTHONUNBUFFERED"))
    for name, standard in (("stdin", 0), ("stdout", 1), ("stderr", 2)):
        raw = unbuffered and standard > 0
        binary = open(standard, "wb" if standard else "rb", 0 if raw else -1, closefd=False)  # noqa: SIM115
        stream = io.TextIOWrapper(
            binary,
            encoding="utf-8",
            errors="backslashreplace" if name == "stderr" else "strict",
            line_buffering=name == "stderr" or os.isatty(standard),
            write_through=raw,
        )
        setattr(sys, name, stream)
        setattr(sys, f"__{name}__", stream)
    sys.orig_argv[:] = request["command"]
    sys.argv[:] = [request["what"] if request["how"] == "file" else request["how"]]
    sys.argv += request["arguments"]
    warnings.resetwarnings()
    for line in (
        "default::DeprecationWarning:__main__",
        "ignore::DeprecationWarning",
        "ignore::PendingDeprecationWarning",
        "ignore::ImportWarning",
        "ignore::ResourceWarning",
    )[::-1]:
        warnings._setoption(line)  # type: ignore[attr-defined]
    sys.warnoptions[:] = filter(None, os.environ.get("PYTHONWARNINGS", "").split(","))
    sys.warnoptions += request["warn"]
    for line in sys.warnoptions:
        warnings._setoption(line)  # type: ignore[attr-defined]


def _run(request: dict[str, Any]) -> None:
    what = request["what"]
    module = types.ModuleType("__main__")
    module.__dict__["__builtins__"] = __builtins__
    sys.modules["__main__"] = module
    if request["how"] == "-m":
        sys.path[0] = os.getcwd()
        runpy._run_module_as_main(what)  # type: ignore[attr-defined]  # as the interpreter does
        return
    if request["how"] == "file":
        sys.path[0] = os.path.dirname(os.path.abspath(what))
        module.__file__ = what
        code = compile(Path(what).read_bytes(), what, "exec", dont_inherit=True)
    else:
        sys.path[0] = ""
        code = compile(what, "<string>", "exec", dont_inherit=True)
    exec(code, module.__dict__)

"""ActionKit on every other supported interpreter of this machine: installed, and a smoke test."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

import pytest

from tests.conftest import without_noise

ROOT = Path(__file__).resolve().parent.parent
SUPPORTED = ("3.10", "3.11", "3.12", "3.13")
RUNNING = f"{sys.version_info.major}.{sys.version_info.minor}"
PROBE = "import sys, venv; print('%d.%d' % sys.version_info[:2])"
INSTALL_TIMEOUT = 600.0

pytestmark = [pytest.mark.long, pytest.mark.heavy]


def clean_environment() -> dict[str, str]:
    """The environment without what belongs to this interpreter's virtual environment.

    ROS from PyPI starts the interpreter again with a library path of its own, once; a child with
    another environment must not inherit that path, nor the mark that it was done.
    """
    ours = {"_ROS_WHEELS_BOOTSTRAP_COMPLETE", "LD_LIBRARY_PATH", "VIRTUAL_ENV"}
    ours |= {"PYTHONPATH", "PYTHONHOME"}
    return {name: value for name, value in os.environ.items() if name not in ours}


def find(version: str) -> Path | None:
    """An interpreter of that version which can make virtual environments."""
    pyenv = Path(os.environ.get("PYENV_ROOT") or Path.home() / ".pyenv")
    candidates = sorted(pyenv.glob(f"versions/{version}.*/bin/python{version}"), reverse=True)
    on_path = shutil.which(f"python{version}")
    for candidate in [*([Path(on_path)] if on_path else []), *candidates]:
        done = subprocess.run(
            [str(candidate), "-c", PROBE],
            capture_output=True,
            text=True,
            env=clean_environment(),
            check=False,
        )
        if done.returncode == 0 and done.stdout.strip() == version:
            return candidate
    return None


def checked(*command: str | Path, timeout: float) -> str:
    """Run a command in the clean environment; an error shows what it said."""
    done = subprocess.run(
        [str(word) for word in command],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=timeout,
        env=clean_environment(),
        check=False,
    )
    assert done.returncode == 0, f"{command} ended with {done.returncode}:\n{done.stdout[-5000:]}"
    return done.stdout


def install(interpreter: Path, wheel: Path, where: Path) -> Path:
    """Make a virtual environment with ActionKit in it; returns its interpreter."""
    checked(interpreter, "-m", "venv", "--without-pip", where, timeout=INSTALL_TIMEOUT)
    python = where / "bin" / "python"
    # Our own pip, run by that interpreter, so that none has to be installed there; and nothing is
    # compiled that the smoke test does not import. It is a quarter less work.
    pip = (sys.executable, "-m", "pip", "--python", python, "install", "-q", "--no-compile")
    # The README's extra, so that this is what its first command installs
    checked(*pip, f"actionkit[demo] @ {wheel.as_uri()}", timeout=INSTALL_TIMEOUT)
    return python


@pytest.fixture(scope="module")
def environments(
    tmp_path_factory: pytest.TempPathFactory,
) -> Iterator[dict[str, Future[Path]]]:
    """For each version found, its environment to be: installed two at a time."""
    interpreters = {v: path for v in SUPPORTED if v != RUNNING and (path := find(v)) is not None}
    if not interpreters:
        yield {}
        return
    scratch = tmp_path_factory.mktemp("interpreters")
    pip = (sys.executable, "-m", "pip")
    checked(*pip, "wheel", "-q", "--no-deps", "-w", scratch, ROOT, timeout=INSTALL_TIMEOUT)
    (wheel,) = scratch.glob("*.whl")
    with ThreadPoolExecutor(2) as workers:
        yield {
            version: workers.submit(install, interpreter, wheel, scratch / version)
            for version, interpreter in interpreters.items()
        }
    shutil.rmtree(scratch, ignore_errors=True)  # hundreds of megabytes


@pytest.mark.timeout(900)
@pytest.mark.parametrize("version", SUPPORTED)
def test_smoke(version: str, environments: dict[str, Future[Path]], tmp_path: Path) -> None:
    if version == RUNNING:
        pytest.skip(f"this is Python {version}: the whole suite runs on it")
    if version not in environments:
        pytest.skip(f"no Python {version} with venv on PATH or among pyenv's versions")
    python = environments[version].result()
    # A copy elsewhere, so that ActionKit can only come from the environment
    script = shutil.copy(ROOT / "tests" / "smoke.py", tmp_path)
    said = without_noise(checked(python, script, timeout=120))
    assert re.search(rf"^smoke passed: actionkit \S+, Python {re.escape(version)}\.", said, re.M)
    assert said.count("\n") == 1, f"it should print nothing else:\n{said}"

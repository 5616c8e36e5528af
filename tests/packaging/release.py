"""Builds a release and checks it: in an empty environment of each Python, wheel and sdist.

    .venv/bin/python -m tests.packaging.release

It needs Python 3.10 to 3.13, on PATH or from pyenv, and takes some minutes. What has passed is in
`build/release`, to be uploaded.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile
import zipfile
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

from packaging.metadata import Metadata

ROOT = Path(__file__).resolve().parents[2]
RELEASE = ROOT / "build" / "release"
SUPPORTED = ("3.10", "3.11", "3.12", "3.13")
PROBE = "import sys, venv; print('%d.%d' % sys.version_info[:2])"
INSTALL_TIMEOUT = 600.0
NOT_COPIED = shutil.ignore_patterns(
    "__pycache__", ".venv*", ".colcon", ".git*", ".*_cache", "build", "dist"
)


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


def checked(*command: str | Path, timeout: float = INSTALL_TIMEOUT, cwd: Path | None = None) -> str:
    """Run a command in the clean environment; an error shows what it said."""
    done = subprocess.run(
        [str(word) for word in command],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=timeout,
        env=clean_environment(),
        cwd=cwd,
        check=False,
    )
    assert done.returncode == 0, f"{command} ended with {done.returncode}:\n{done.stdout[-5000:]}"
    return done.stdout


def build(scratch: Path) -> tuple[Path, Path]:
    """Build an sdist from a copy of the checkout, and a wheel from that sdist; return both."""
    copy, out = scratch / "checkout", scratch / "dist"
    shutil.copytree(ROOT, copy, ignore=NOT_COPIED)
    hatchling = (sys.executable, "-m", "hatchling", "build", "-d", out)
    checked(*hatchling, "-t", "sdist", cwd=copy)
    (sdist,) = out.glob("*.tar.gz")
    with tarfile.open(sdist) as archive:
        archive.extractall(scratch, filter="data")
    checked(*hatchling, "-t", "wheel", cwd=scratch / sdist.name.removesuffix(".tar.gz"))
    (wheel,) = out.glob("*.whl")
    return sdist, wheel


def check_contents(sdist: Path, wheel: Path) -> str:
    """Check the files and the metadata of both; return the version."""
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
        (where,) = (name for name in names if name.endswith(".dist-info/METADATA"))
        metadata = Metadata.from_email(archive.read(where), validate=True)
    version = str(metadata.version)
    # The stubs for rclpy, above all, are for this repository alone.
    assert {name.split("/")[0] for name in names} == {"actionkit", f"actionkit-{version}.dist-info"}
    assert "actionkit/py.typed" in names
    assert f"actionkit-{version}.dist-info/licenses/LICENSE" in names
    assert not [name for name in names if name.endswith(".pyi")]
    with tarfile.open(sdist) as archive_of_sources:
        files = {name.partition("/")[2] for name in archive_of_sources.getnames()}
    needed = {"pyproject.toml", "package.xml", "setup.py", "setup.cfg", "resource/actionkit"}
    assert needed | {"LICENSE", "README.md", "stubs/rclpy/node.pyi"} <= files

    assert metadata.license_expression == "Apache-2.0"
    # The page on PyPI has no links that work in a checkout alone.
    page = metadata.description or ""
    assert page.startswith("# ActionKit")
    assert "pip install 'actionkit[demo]'" in page
    assert not re.findall(r"\]\((?!https?:)[^)]*\)", page)
    history = (ROOT / "docs" / "CHANGELOG.md").read_text("utf-8")
    assert re.search(rf"^## {re.escape(version)}\b", history, re.M), (
        "the changelog has no such version"
    )
    return version


def install(interpreter: Path, what: Path, where: Path) -> Path:
    """Make a virtual environment with ActionKit in it; returns its interpreter."""
    checked(interpreter, "-m", "venv", "--without-pip", where)
    python = where / "bin" / "python"
    # Our own pip, run by that interpreter, so that none has to be installed there; and nothing is
    # compiled that the smoke test does not import. It is a quarter less work.
    pip = (sys.executable, "-m", "pip", "--python", python, "install", "-q", "--no-compile")
    # The README's extra, so that this is what its first command installs
    checked(*pip, f"actionkit[demo] @ {what.as_uri()}")
    return python


def smoke(python: Path, where: Path) -> str:
    """Run the smoke test with an interpreter; returns what it printed."""
    # A copy elsewhere, so that ActionKit can only come from the environment
    script = shutil.copy(ROOT / "tests" / "smoke.py", where)
    return checked(python, script, timeout=120)


def main() -> None:
    """Check everything; the first thing that is wrong ends it with an error."""
    missing = [version for version in SUPPORTED if find(version) is None]
    if missing:
        sys.exit(f"no Python {', '.join(missing)} on PATH or among pyenv's versions")
    with tempfile.TemporaryDirectory(prefix="actionkit-release.") as folder:
        scratch = Path(folder)
        built = build(scratch)
        version = check_contents(*built)
        print(f"actionkit {version}: files and metadata are right", flush=True)

        def one(python: str, file: Path) -> str:
            where = scratch / f"{python}-{file.suffix}"
            interpreter = find(python)
            assert interpreter is not None
            try:
                return smoke(install(interpreter, file, where), where)
            finally:
                shutil.rmtree(where, ignore_errors=True)  # hundreds of megabytes

        with ThreadPoolExecutor(2) as workers:
            cells: dict[str, Future[str]] = {
                f"{file.name} on Python {python}": workers.submit(one, python, file)
                for python in SUPPORTED
                for file in built
            }
            for cell, said in cells.items():
                assert f"smoke passed: actionkit {version}, Python" in said.result()
                print(f"{cell}: passed", flush=True)
        shutil.rmtree(RELEASE, ignore_errors=True)
        RELEASE.mkdir(parents=True)
        for file in built:
            shutil.copy(file, RELEASE)
    print(f"to be uploaded: {', '.join(str(RELEASE / file.name) for file in built)}")


if __name__ == "__main__":
    main()

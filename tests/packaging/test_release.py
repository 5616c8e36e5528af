"""A release: its files and metadata, and a smoke test on every other interpreter of this machine.

`python -m tests.packaging.release` does all of it, with the sdist too, before a release.
"""

from __future__ import annotations

import re
import shutil
import sys
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

import pytest

from tests.conftest import without_noise
from tests.packaging import release

RUNNING = f"{sys.version_info.major}.{sys.version_info.minor}"

pytestmark = [pytest.mark.long, pytest.mark.heavy]


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Path, Path]]:
    scratch = tmp_path_factory.mktemp("release")
    yield release.build(scratch)
    shutil.rmtree(scratch, ignore_errors=True)  # hundreds of megabytes


@pytest.fixture(scope="module")
def environments(built: tuple[Path, Path]) -> Iterator[dict[str, Future[Path]]]:
    """For each version found, its environment to be: installed two at a time."""
    _, wheel = built
    others = [version for version in release.SUPPORTED if version != RUNNING]
    with ThreadPoolExecutor(2) as workers:
        yield {
            version: workers.submit(release.install, path, wheel, wheel.parent / version)
            for version in others
            if (path := release.find(version)) is not None
        }


def test_its_files_and_metadata(built: tuple[Path, Path]) -> None:
    release.check_contents(*built)


@pytest.mark.timeout(900)
@pytest.mark.parametrize("version", release.SUPPORTED)
def test_smoke(version: str, environments: dict[str, Future[Path]], tmp_path: Path) -> None:
    if version == RUNNING:
        pytest.skip(f"this is Python {version}: the whole suite runs on it")
    if version not in environments:
        pytest.skip(f"no Python {version} with venv on PATH or among pyenv's versions")
    said = without_noise(release.smoke(environments[version].result(), tmp_path))
    assert re.search(rf"^smoke passed: actionkit \S+, Python {re.escape(version)}\.", said, re.M)
    assert said.count("\n") == 1, f"it should print nothing else:\n{said}"

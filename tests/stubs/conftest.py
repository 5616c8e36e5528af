"""Interface packages that were not compiled, and the command `actionkit stubs` for them."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from tests import forked

MAKER = Path(__file__).with_name("interfaces.py")

ODD = {
    # Fields that are called as what an annotation is made of
    "msg/Odd.msg": """
        int32 LIMIT = 7
        float64 HALF = 0.5
        string WORD = "it's"
        bool YES = true
        int32[] array
        string<=5 str
        int8 self
        float32[3] int
        string[] list
        bool property
        uint8[<=4] typing
        float64 float
        byte bytes
        bool[] bool
        int32 dict
        int32 tuple
        int32 classmethod
        int32 numpy
        Part[<=2] object
        wstring<=3 type
        uint8 check_fields
    """,
    "msg/Part.msg": "int64 number 3\n",
    "msg/Lost.msg": "Part part\n",
    "msg/Wide.msg": "\n".join(f"int32 field{number}" for number in range(200)),
    "action/Pick.action": "string item\nOdd odd\n---\nbool ok\n---\nfloat32 percent\n",
}
BROKEN = {
    "msg/Broken.msg": "int32 class\n",  # a word of Python's: what rosidl generates is no Python
    "srv/Whole.srv": "int32 number\n---\n",
}
PLAIN = {"msg/Plain.msg": "int32 number\nstring[<=3] words\n", "msg/Second.msg": "Plain plain\n"}


def make(folder: Path, package: str, files: dict[str, str]) -> None:
    """Make a package in a folder."""
    for name, text in files.items():
        path = folder / "src" / package / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("\n".join(map(str.strip, text.splitlines())) + "\n")
    forked.run([sys.executable, str(MAKER), str(folder), package], check=True, timeout=120)


def lose(folder: Path) -> None:
    """Make the type Lost refer to a package that is not there."""
    path = folder / "odd_interfaces" / "msg" / "_lost.py"
    path.write_text(
        path.read_text().replace("'odd_interfaces', 'msg'], 'Part'", "'gone', 'msg'], 'Part'")
    )


@pytest.fixture(scope="session")
def interfaces(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the packages {odd,broken,plain}_interfaces, to be read only."""
    folder = tmp_path_factory.mktemp("interfaces")
    make(folder, "odd_interfaces", ODD)
    lose(folder)
    make(folder, "broken_interfaces", BROKEN)
    make(folder, "plain_interfaces", PLAIN)
    return folder


Command = Callable[..., "subprocess.CompletedProcess[str]"]


@pytest.fixture
def stubs(interfaces: Path, tmp_path: Path) -> Command:
    """Run `actionkit stubs ARGUMENTS` in an empty folder, beside the packages of `interfaces`."""

    def run(
        *arguments: str, path: Path = interfaces, before: tuple[str, ...] = ()
    ) -> subprocess.CompletedProcess[str]:
        return forked.run(
            [*before, sys.executable, "-m", "actionkit", "stubs", *arguments],
            capture_output=True,
            text=True,
            check=False,
            timeout=120,
            cwd=tmp_path,
            env={**os.environ, "PYTHONPATH": str(path)},
        )

    return run

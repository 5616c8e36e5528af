"""For colcon alone, which runs nothing but setup.py; pip builds with hatchling.

Name, version and entry points are those of pyproject.toml, so that nothing is said twice.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from setuptools import Distribution, find_packages, setup

try:
    import tomllib
except ImportError:  # Python 3.10
    import tomli as tomllib  # type: ignore[no-redef,import-not-found,unused-ignore]  # python3-tomli

HERE = Path(__file__).resolve().parent


class WithoutPyproject(Distribution):
    """Reads setup.cfg alone.

    setuptools before 77 refuse the license of our `[project]` table, and from what later ones make
    of that table colcon cannot read the name.
    """

    def parse_config_files(self, filenames: Any = None, ignore_option_errors: bool = False) -> None:
        super().parse_config_files(["setup.cfg"], ignore_option_errors)


project = tomllib.loads((HERE / "pyproject.toml").read_text("utf-8"))["project"]
groups = {"console_scripts": project["scripts"], **project["entry-points"]}
setup(
    distclass=WithoutPyproject,
    name=project["name"],
    version=project["version"],
    description=project["description"],
    license=project["license"],
    python_requires=project["requires-python"],
    packages=find_packages(include=["actionkit", "actionkit.*"]),
    package_data={"actionkit": ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/actionkit"]),
        ("share/actionkit", ["package.xml"]),
    ],
    entry_points={
        group: [f"{name} = {where}" for name, where in names.items()]
        for group, names in groups.items()
    },
)

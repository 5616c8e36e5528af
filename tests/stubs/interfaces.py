"""Makes interface packages for tests, with rosidl's own generators: Python without type support.

Usage: interfaces.py FOLDER PACKAGE. The interface files are in FOLDER/src/PACKAGE; the package
comes to be in FOLDER/PACKAGE.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

from rosidl_adapter import convert_to_idl
from rosidl_generator_py import generate_py


def main(folder: Path, package: str) -> None:
    source, out = folder / "src" / package, folder / package
    idls = []
    for path in sorted(source.glob("*/*.*")):
        relative = path.relative_to(source)
        target = folder / "idl" / package / relative.parent
        target.mkdir(parents=True, exist_ok=True)
        (out / relative.parent).mkdir(parents=True, exist_ok=True)
        convert_to_idl(source, package, relative, target.parent)
        idls.append(f"{target.parent}:{relative.with_suffix('.idl').as_posix()}")
    arguments = {
        "package_name": package,
        "output_dir": str(out),
        "template_dir": str(Path(sys.prefix, "share", "rosidl_generator_py", "resource")),
        "idl_tuples": idls,
        "target_dependencies": [],
        "ros_interface_dependencies": [],
    }
    file = folder / f"{package}.json"
    file.write_text(json.dumps(arguments))
    generate_py(str(file), [])
    (out / "__init__.py").touch()


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2])

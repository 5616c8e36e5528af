#!/usr/bin/env bash
# The tests of the default tier on ROS 2 Kilted, whose rclpy is on PyPI too. Other arguments replace
# the tests:
#   bash tests/kilted.sh tests/client/test_call.py
# PYTHON=python3.12 takes that Python; the environment stays in .venv-kilted for the next time.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
unset VIRTUAL_ENV PYTHONPATH PYTHONHOME _ROS_WHEELS_BOOTSTRAP_COMPLETE LD_LIBRARY_PATH

place=.venv-kilted
if [ ! -e "$place/ready" ]; then
  "${PYTHON:-python3}" -m venv --clear "$place"
  # What `.[dev]` would install, with the packages of Kilted in place of Jazzy's.
  "$place/bin/python" - >"$place/needs.txt" <<'P'
import re
from pip._vendor import tomli
with open("pyproject.toml", "rb") as file:
    extras = tomli.load(file)["project"]["optional-dependencies"]
def needs(extra):
    for need in extras[extra]:
        own = re.fullmatch(r"actionkit\[(.*)\]", need)
        if own:
            for other in own[1].split(","):
                yield from needs(other)
        else:
            yield need.replace("ros-jazzy-", "ros-kilted-")
print("\n".join(dict.fromkeys(needs("dev"))))
P
  "$place/bin/pip" install --quiet -e . -r "$place/needs.txt"
  touch "$place/ready"
fi
if [ $# = 0 ]; then
  # The others are about packages of Jazzy, or about the checkout, and not about rclpy.
  set -- tests/client tests/faults tests/cli tests/awaiting tests/trees tests/servers \
    tests/fake_server tests/agents tests/unit tests/soak
fi
exec "$place/bin/python" -m pytest -q "$@"

#!/usr/bin/env bash
# The tests of the default tier on ROS 2 Kilted, whose rclpy is on PyPI too; or those that are given:
#   bash tests/kilted.sh tests/client/test_call.py
# PYTHON=python3.12 takes that Python; the environment stays in .venv-kilted for the next time.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
unset VIRTUAL_ENV PYTHONPATH PYTHONHOME _ROS_WHEELS_BOOTSTRAP_COMPLETE LD_LIBRARY_PATH

place=.venv-kilted
if [ ! "$place/ready" -nt pyproject.toml ]; then # it is missing, or older
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
# Kilted's ActionServer calls `logger.warn`, which is deprecated there. Warnings are errors in these
# tests, so a server in the test's process would answer nothing more.
exec "$place/bin/python" -m pytest -q \
  -W "ignore:Deprecated in favor of:DeprecationWarning:rclpy.action.server" "$@"

#!/usr/bin/env bash
# The core of the suite on ROS 2 Kilted, whose rclpy is on PyPI too. Other arguments replace the tests:
#   bash tests/kilted.sh tests/client/test_call.py
# PYTHON=python3.12 takes that Python; the environment stays in .venv-kilted for the next time.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
unset VIRTUAL_ENV PYTHONPATH PYTHONHOME _ROS_WHEELS_BOOTSTRAP_COMPLETE LD_LIBRARY_PATH

place=.venv-kilted
if [ ! -e "$place/ready" ]; then
  "${PYTHON:-python3}" -m venv --clear "$place"
  # Not the extra `test`, which asks for the packages of Jazzy.
  "$place/bin/pip" install --quiet -e . \
    'ros-kilted-rclpy[fastrtps]' ros-kilted-test-msgs ros-kilted-geometry-msgs \
    'pytest>=8.4' pytest-timeout pytest-xdist hypothesis anyio trio uvloop 'opentelemetry-sdk>=1.31'
  touch "$place/ready"
fi
if [ $# = 0 ]; then
  set -- tests/client tests/faults/test_processes.py tests/cli
fi
exec "$place/bin/python" -m pytest -q "$@"

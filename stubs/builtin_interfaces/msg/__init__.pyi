# Made by `actionkit stubs`, which overwrites it.
# fmt: off
# ruff: noqa

from builtin_interfaces.msg._duration import Duration as Duration
from builtin_interfaces.msg._time import Time as Time

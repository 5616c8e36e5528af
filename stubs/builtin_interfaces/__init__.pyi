# Made by `actionkit stubs`, which overwrites it.
# fmt: off
# ruff: noqa

# Made by `actionkit stubs`, which overwrites it.
# fmt: off
# ruff: noqa

from unique_identifier_msgs.msg._uuid import UUID as UUID

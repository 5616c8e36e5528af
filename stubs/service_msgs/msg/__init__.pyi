# Made by `actionkit stubs`, which overwrites it.
# fmt: off
# ruff: noqa

from service_msgs.msg._service_event_info import ServiceEventInfo as ServiceEventInfo

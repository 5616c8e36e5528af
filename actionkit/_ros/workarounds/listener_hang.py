"""Works around a hang of Fast DDS that can happen when a node is destroyed.

When the last node of a context is destroyed, so is its DDS participant. Before that, rmw_fastrtps
removes the participant's listener with `DomainParticipant::set_listener(nullptr)`, which waits
without limit for callbacks that are running. In Fast DDS 2.14 the time of that unlimited wait
overflows, and the wait never releases the lock that the callback needs. If a remote endpoint is
discovered or leaves at that moment, the thread spins for ever and holds Python's GIL, so that not
even Ctrl-C works. (Seen once in about 500 nodes that were destroyed while others came and went.)

A wait with a limit works as it should. So the listener is removed here first, with a limit; after
that the unlimited wait has nothing to wait for.

This can be deleted when eProsima/Fast-DDS#6513 is mended in the oldest Fast DDS that is supported
(it was open in November 2026, for all versions).
"""

from __future__ import annotations

import ctypes
import os
from functools import cache
from typing import Any

from rclpy.node import Node

_LONGEST_WAIT = 5
"""Seconds; a callback takes well under a millisecond."""
_GET_PARTICIPANT = "_ZN16rmw_fastrtps_cpp22get_domain_participantEP10rmw_node_s"
"""`rmw_fastrtps_cpp::get_domain_participant(rmw_node_t *)`"""
_SET_LISTENER = (
    "_ZN8eprosima7fastdds3dds17DomainParticipant12set_listenerEPNS1_25DomainParticipantListenerE"
    "NSt6chrono8durationIlSt5ratioILl1ELl1EEEE"
)
"""`DomainParticipant::set_listener(DomainParticipantListener *, std::chrono::seconds)`"""


class _FastDds:
    """The functions that are needed, from libraries that rclpy has already loaded."""

    def __init__(self) -> None:
        mode = os.RTLD_NOLOAD | os.RTLD_LAZY
        rcl = ctypes.CDLL("librcl.so", mode)
        rmw = ctypes.CDLL("librmw_fastrtps_cpp.so", mode)
        self.rmw_handle = _function(rcl, "rcl_node_get_rmw_handle", ctypes.c_void_p, 1)
        self.participant = _function(rmw, _GET_PARTICIPANT, ctypes.c_void_p, 1)
        self.set_listener = _function(rmw, _SET_LISTENER, ctypes.c_uint32, 2)
        self.set_listener.argtypes = [*self.set_listener.argtypes, ctypes.c_int64]


def _function(library: ctypes.CDLL, symbol: str, returns: Any, pointers: int) -> Any:
    function = getattr(library, symbol)
    function.restype = returns
    function.argtypes = [ctypes.c_void_p] * pointers
    return function


@cache
def _fast_dds() -> _FastDds | None:
    try:
        return _FastDds()
    except (OSError, AttributeError):
        return None  # another middleware, or another version of this one: not affected


def stop_listening(node: Node) -> bool:
    """Remove the listener of a node's participant, before the node is destroyed.

    Call it for the last node of a context, after its entities were destroyed. The node discovers
    nothing afterwards. The GIL is released while this waits. Return `False` if it was not done:
    with another middleware, or if a callback did not end.
    """
    library = _fast_dds()
    if library is None:
        return False
    with node.handle:
        participant = library.participant(library.rmw_handle(node.handle.pointer))
        if not participant:
            return False
        return bool(library.set_listener(participant, None, _LONGEST_WAIT) == 0)

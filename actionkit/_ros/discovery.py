"""Keeping Fast DDS from hanging for ever where a node goes while others come or go.

The last node of a context takes its DDS participant with it. Before that, rmw_fastrtps detaches
the participant's listener with `DomainParticipant::set_listener(nullptr)`, which waits for
callbacks under way without end. In Fast DDS 2.14 that endless wait overflows and never lets go of
the lock that the callback needs: where a remote endpoint is discovered, or leaves, at just that
moment, the thread spins for ever, with Python's GIL held, and not even Ctrl-C is heard. (Seen
once in some 500 nodes that were destroyed while others came and went.)

A wait with an end is done right there. So the listener is detached here first, after which the
endless one has nothing to wait for.
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
    """What is needed of the libraries; loads none that is not loaded."""

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
    """Let the participant of a node hear no more of others, before it is destroyed.

    Call it for the last node of a context, with its entities destroyed; no event of discovery
    reaches the node afterwards. Lets go of the GIL while it waits.

    Args:
        node: A node that is not destroyed.

    Returns:
        Whether it was done; `False` with another middleware, or where a callback did not end.
    """
    library = _fast_dds()
    if library is None:
        return False
    with node.handle:
        participant = library.participant(library.rmw_handle(node.handle.pointer))
        if not participant:
            return False
        return bool(library.set_listener(participant, None, _LONGEST_WAIT) == 0)
